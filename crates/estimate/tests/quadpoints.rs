mod support;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use estimate::{true_errors, Exact};
use fem_core::{Constant, Field, FieldError, Samples, Mesh};
use contact::*;
use fem_core::integrate::Loads;
struct Counted<F>(F, Arc<AtomicUsize>);
impl<F: Fn(f64,f64)->f64+Send+Sync> Field for Counted<F> {
    fn sample(&self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        self.1.fetch_add(at.len(), Ordering::Relaxed);
        for k in 0..out.len() { out[k] = (self.0)(at.x[k], at.y[k]); }
        Ok(())
    }
}
fn right(n: usize, l: bool) -> Mesh {
    let m = n + 1;
    let mut pts = vec![]; for j in 0..m { for i in 0..m { pts.push([-1.0 + 2.0*i as f64/n as f64, -1.0+2.0*j as f64/n as f64]); } }
    let mut tr: Vec<[u32;3]> = vec![];
    for j in 0..n { for i in 0..n { if l && i >= n/2 && j < n/2 { continue; }
        let a=(j*m+i) as u32; let (b,c,d)=(a+1,a+m as u32+1,a+m as u32); tr.push([a,b,c]); tr.push([a,c,d]); } }
    let mut used = vec![u32::MAX; pts.len()]; let mut np = vec![];
    for t in tr.iter_mut() { for v in t.iter_mut() { let o=*v as usize; if used[o]==u32::MAX { used[o]=np.len() as u32; np.push(pts[o]); } *v = used[o]; } }
    Mesh::new(np, &tr, &[], None).unwrap()
}
fn run(name: &str, mesh: &Mesh, v: &dyn Fn(f64,f64)->f64, gx: impl Fn(f64,f64)->f64+Send+Sync+'static+Copy, gy: impl Fn(f64,f64)->f64+Send+Sync+'static+Copy, mu: Option<Arc<dyn Field>>) {
    let nv = mesh.vertex_count(); let nt = mesh.triangle_count();
    let u: Vec<f64> = mesh.points().iter().map(|p| v(p[0],p[1])).collect();
    let z = vec![0.0; nv];
    let loads = Loads{nodal: z.clone(), mean: vec![0.0;nt], deviation_squared: vec![0.0;nt]};
    let mu: Arc<dyn Field> = mu.unwrap_or(Arc::new(Constant(1.0)));
    let mean = fem_core::integrate::means(mesh, mu.as_ref()).unwrap();
    let problem = DiscreteProblem::new(mesh, [mean.clone(), mean], [loads.clone(), loads], [z.clone(), z.clone()]);
    let sol = Solution{displacement:[u.clone(), u], force: z.clone(), sigma: z.clone(), contact: vec![false;nv], info: SolveInfo{solver:"x",reduction:Reduction::TwoField,status:Status::Converged,iterations:0,unknowns:0,kkt_residual:0.0}};
    let cnt = Arc::new(AtomicUsize::new(0));
    let exact = Exact{displacement: [[Arc::new(Counted(gx,cnt.clone())), Arc::new(gy)], [Arc::new(gx), Arc::new(gy)]], sigma: None, action: None, contact: None};
    let t = std::time::Instant::now();
    let e = true_errors(mesh, &problem, &sol, &exact, &[mu.clone(), mu]).unwrap();
    println!("{name} {nt}: h1 {:.10e} energy {:.10e} points/tri {:.2} {:?}", e.h1[0], e.energy, cnt.load(Ordering::Relaxed) as f64/nt as f64, t.elapsed());
}
#[test]
fn quadpoints() {
    let q = move |x: f64,y: f64| (1.0-x*x)*(1.0-y*y);
    for n in [8, 16, 32,64,128, 256] {
        let m = right(n,false);
        let c = move |x: f64,y: f64| (x*x+y*y-0.25).max(0.0);
        run("P2", &m, &|x,y| q(x,y)*(1.0/3.0+2.0/3.0*c(x,y).powi(2)),
            move |x,y| -2.0*x*(1.0-y*y)*(1.0/3.0+2.0/3.0*c(x,y).powi(2)) + q(x,y)*8.0/3.0*x*c(x,y),
            move |x,y| -2.0*y*(1.0-x*x)*(1.0/3.0+2.0/3.0*c(x,y).powi(2)) + q(x,y)*8.0/3.0*y*c(x,y), None);
        run("smooth", &m, &|x,y| (3.0*x).sin()*(2.0*y).exp(), |x,y| 3.0*(3.0*x).cos()*(2.0*y).exp(), |x,y| 2.0*(3.0*x).sin()*(2.0*y).exp(), None);
        run("smoothmu", &m, &|x,y| (3.0*x).sin()*(2.0*y).exp(), |x,y| 3.0*(3.0*x).cos()*(2.0*y).exp(), |x,y| 2.0*(3.0*x).sin()*(2.0*y).exp(), Some(Arc::new(|x: f64,y: f64| (x*y+y).exp())));
        run("jump", &m, &|x,y| { let mu = if x>1.0/3.0 {1e4} else {1.0}; q(x,y)*(x-1.0/3.0)/mu },
          move |x,y| { let mu = if x>1.0/3.0 {1e4} else {1.0}; (-2.0*x*(1.0-y*y)*(x-1.0/3.0)+q(x,y))/mu },
          move |x,y| { let mu = if x>1.0/3.0 {1e4} else {1.0}; (-2.0*y*(1.0-x*x)*(x-1.0/3.0))/mu }, Some(Arc::new(|x: f64,_y: f64| if x>1.0/3.0 {1e4} else {1.0})));
        run("linear", &m, &|x,y| 0.3*x+0.1*y, |_,_| 0.3, |_,_| 0.1, None);
        run("linearnoise", &m, &|x,y| 0.3*x+0.1*y, |x,_| 0.3*((x*1e3).sin().powi(2)+(x*1e3).cos().powi(2)), |x,y| 0.1+x*y-y*x+1e-14*(1e5*x*y).sin(), None);
        let m = right(n,true);
        let th = |x: f64,y: f64| 0.75*std::f64::consts::PI + f64::atan2(-(x+y),y-x);
        run("corner", &m, &|x,y| (x*x+y*y).cbrt()*(2.0/3.0*th(x,y)).sin(),
            move |x,y| 2.0/3.0*(x*x+y*y).powf(-1.0/6.0)*(-th(x,y)/3.0).sin(),
            move |x,y| 2.0/3.0*(x*x+y*y).powf(-1.0/6.0)*(-th(x,y)/3.0).cos(), None);
        // r^0.1: stronger
        run("r^.1", &m, &|x,y| (x*x+y*y).powf(0.05), |x,y| 0.1*x*(x*x+y*y).powf(-0.95), |x,y| 0.1*y*(x*x+y*y).powf(-0.95), None);
    }
}
