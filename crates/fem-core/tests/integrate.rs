//! Loads and means of smooth, jumping and singular data.

use fem_core::integrate::{
    Loads, Reference, load_pair, load_pair_carried, load_pair_relative_to, loads, means,
    means_carried,
};
use fem_core::{Children, Circle, Constant, Field, FieldError, Mesh, Samples, TriangleId};

fn square(refinements: usize) -> Mesh {
    let points = vec![[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mut mesh = Mesh::new(points, &[[0, 1, 2], [0, 2, 3]], &[], None).expect("a square");
    for _ in 0..refinements {
        mesh.refine_uniformly(Children::Four).expect("refines");
    }
    mesh
}

fn total(values: &[f64]) -> f64 {
    values.iter().sum()
}

#[test]
fn polynomials_are_integrated_exactly() {
    let mesh = square(2);
    let f = |x: f64, y: f64| 3.0 * x.powi(4) - x * y * y + 2.0;
    let l = loads(&mesh, &f).expect("finite");
    // Against the affine function 1 + x, whose nodal values are known: degree five in all.
    let paired: f64 = l
        .nodal
        .iter()
        .zip(mesh.points())
        .map(|(m, p)| m * (1.0 + p[0]))
        .sum();
    let exact = 3.0 * 4.0 / 5.0 + 2.0 * 4.0 - 4.0 / 9.0;
    assert!((paired - exact).abs() < 1e-14, "{paired} {exact}");
    let squares: f64 = (0..mesh.triangle_count())
        .map(|t| l.deviation_squared(t))
        .sum::<f64>();
    assert!(squares > 0.1);
    let c = loads(&mesh, &Constant(0.3)).expect("finite");
    assert!((total(&c.nodal) - 1.2).abs() < 1e-15);
    assert!((0..mesh.triangle_count()).all(|t| c.deviation_squared(t) == 0.0));
    let c = loads(&mesh, &|_: f64, _: f64| 0.3).expect("finite");
    assert!((0..mesh.triangle_count()).all(|t| c.deviation_squared(t) == 0.0 && c.mean(t) == 0.3));
}

#[test]
fn a_jump_inside_elements_is_followed() {
    let step = |x: f64, y: f64| f64::from(x * x + y * y < 0.5);
    let exact = 0.5 * std::f64::consts::PI;
    // The rule resolves the circle to 1e-4 of the whole on every mesh, coarse or fine.
    for level in 1..6 {
        let mesh = square(level);
        let l = loads(&mesh, &step).expect("finite");
        assert!(
            (total(&l.nodal) - exact).abs() < 3e-4,
            "{level}: {}",
            total(&l.nodal) - exact
        );
        // ||f||^2 = sum of means squared and deviations: the same number, since f is 0 or 1.
        let norm: f64 = mesh
            .triangle_ids()
            .map(|t| {
                mesh.shape(t).area * l.mean(t.index()).powi(2) + l.deviation_squared(t.index())
            })
            .sum();
        assert!((norm - exact).abs() < 3e-4, "{level}: {}", norm - exact);
    }
}

#[test]
fn a_singular_corner_is_graded() {
    let f = |x: f64, y: f64| (x * x + y * y).powf(-1.0 / 6.0);
    let mesh = square(2);
    let l = loads(&mesh, &f).expect("finite inside elements");
    // Integral of r^(-1/3) over the square: 8 times that over the triangle 0 < y < x < 1, in polar coordinates
    // (3/5) int_0^(pi/4) cos^(-5/3), by Simpson's rule.
    let n = 2000;
    let h = std::f64::consts::FRAC_PI_4 / n as f64;
    let g = |i: usize| (i as f64 * h).cos().powf(-5.0 / 3.0);
    let simpson: f64 = (0..n / 2)
        .map(|i| g(2 * i) + 4.0 * g(2 * i + 1) + g(2 * i + 2))
        .sum::<f64>()
        * h
        / 3.0;
    let exact = 8.0 * 0.6 * simpson;
    assert!(
        (total(&l.nodal) / exact - 1.0).abs() < 1e-5,
        "{} {exact}",
        total(&l.nodal)
    );
}

#[test]
fn means_of_smooth_tensions_have_ten_digits() {
    let mesh = square(2);
    let mu = |x: f64, y: f64| (0.7 * x - y).exp();
    let m = means(&mesh, &mu).expect("finite");
    let whole: f64 = mesh
        .triangle_ids()
        .map(|t| mesh.shape(t).area * m[t.index()])
        .sum();
    let exact = (2.0 * 0.7f64.sinh() / 0.7) * 2.0 * 1f64.sinh();
    assert!(
        (whole / exact - 1.0).abs() < 1e-11,
        "{}",
        whole / exact - 1.0
    );
    let aligned = means(&mesh, &|x: f64, _: f64| if x > 0.0 { 1e4 } else { 1.0 }).expect("finite");
    assert!(aligned.stored().iter().all(|&m| m == 1.0 || m == 1e4));
    let cut = means(&mesh, &|x: f64, _: f64| {
        if x > 1.0 / 3.0 { 1e4 } else { 1.0 }
    })
    .expect("finite");
    let whole: f64 = mesh
        .triangle_ids()
        .map(|t| mesh.shape(t).area * cut[t.index()])
        .sum();
    let exact = 2.0 * (4.0 / 3.0 + 1e4 * 2.0 / 3.0);
    assert!(
        (whole / exact - 1.0).abs() < 2e-3,
        "{}",
        whole / exact - 1.0
    );
}

/// Counts its samples.
struct Counting(std::sync::atomic::AtomicUsize);

impl Field for Counting {
    fn sample(&self, at: Samples<'_>, out: &mut [f64]) -> Result<(), FieldError> {
        self.0
            .fetch_add(at.len(), std::sync::atomic::Ordering::Relaxed);
        for (k, v) in out.iter_mut().enumerate() {
            *v = (at.x[k] + 2.0 * at.y[k]).sin();
        }
        Ok(())
    }
}

#[test]
fn smooth_data_on_a_fine_mesh_cost_seven_points() {
    let mesh = square(7);
    let f = Counting(0.into());
    let fields: [&dyn Field; 2] = [&f, &Constant(0.0)];
    let reference = Reference::of(&square(1), fields).expect("finite");
    f.0.store(0, std::sync::atomic::Ordering::Relaxed);
    load_pair_relative_to(&reference, &mesh, fields, 1).expect("finite");
    assert_eq!(f.0.into_inner(), 7 * mesh.triangle_count());
}

/// Far from the origin quarters of quarters collapse to a few points; sampling them ever more finely once cost seconds.
#[test]
fn quartering_ends_at_the_spacing_of_the_coordinates() {
    let far = 1e14;
    let points = square(3)
        .points()
        .iter()
        .map(|p| p.map(|x| far + x))
        .collect();
    let triangles: Vec<_> = square(3)
        .triangles()
        .iter()
        .map(|t| t.map(|v| v.0))
        .collect();
    let mesh = Mesh::new(points, &triangles, &[], None).expect("far away");
    let samples = std::sync::atomic::AtomicUsize::new(0);
    let singular = |x: f64, y: f64| {
        samples.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        (x - far - 0.3).hypot(y - far - 0.7).powf(-1.99).min(1e30)
    };
    loads(&mesh, &singular).expect("finite");
    let samples = samples.into_inner();
    assert!(samples < 1_000_000, "{samples}");
}

#[test]
fn a_value_that_is_not_finite_says_where() {
    let error = loads(&square(3), &|x: f64, _: f64| 1.0 / (x - 0.5).max(0.0))
        .expect_err("infinite left of 0.5");
    assert!(error.value.is_infinite() && error.x <= 0.5, "{error}");
}

/// Refines some triangles, chosen by a generator, a dozen times, and shows every mesh with the parents of its triangles.
fn refined(mut mesh: Mesh, mut look: impl FnMut(&Mesh, &[TriangleId])) {
    let mut state = 7u64;
    for round in 0..12 {
        let mut random = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            state >> 33
        };
        // A few triangles of a large mesh, about half of a small one.
        let some = 2 + mesh.triangle_count() as u64 / 64;
        let marked: Vec<TriangleId> = mesh
            .triangle_ids()
            .filter(|_| random() % some == 0)
            .collect();
        let children = if round % 2 == 0 {
            Children::Four
        } else {
            Children::Two
        };
        let refinement = mesh.refine(&marked, children).expect("refines");
        look(&mesh, &refinement.parent);
    }
}

#[test]
fn data_carried_over_are_those_found_afresh() {
    let points = vec![[-0.7, -0.7], [0.7, -0.7], [0.7, 0.7], [-0.7, 0.7]];
    let circle = Circle {
        center: [0.0, 0.0],
        radius: 0.7 * 2f64.sqrt(),
    };
    let disk =
        Mesh::new(points, &[[0, 1, 2], [0, 2, 3]], &[], Some(circle)).expect("a coarse disk");
    let jump = |x: f64, y: f64| {
        if x * x + y * y < 0.3 {
            2.0 + x
        } else {
            -y.exp()
        }
    };
    let smooth = |x: f64, y: f64| (3.0 * x).sin() * y;
    let still = Constant(-1.5);
    let pairs: [[&dyn Field; 2]; 3] = [[&jump, &smooth], [&still, &jump], [&still, &still]];
    for fields in pairs {
        let reference = Reference::of(&disk, fields).expect("finite");
        let mut before = load_pair_relative_to(&reference, &disk, fields, 1).expect("finite");
        refined(disk.clone(), |mesh, parent| {
            let carried = load_pair_carried(mesh, fields, &before, parent, 1).expect("finite");
            let fresh = load_pair_relative_to(&reference, mesh, fields, 1).expect("finite");
            for (carried, fresh) in carried.iter().zip(&fresh) {
                assert_eq!(carried.nodal, fresh.nodal);
                for t in mesh.triangle_ids() {
                    let all = |l: &Loads| {
                        let t = t.index();
                        (l.mean(t), l.deviation_squared(t), l.moments(t, 1.0))
                    };
                    assert_eq!(all(carried), all(fresh), "{t:?}");
                }
            }
            before = carried;
        });
    }
    for field in pairs.as_flattened() {
        let mut before = means(&disk, *field).expect("finite");
        refined(disk.clone(), |mesh, parent| {
            let carried = means_carried(mesh, *field, &before, parent).expect("finite");
            assert_eq!(carried, means(mesh, *field).expect("finite"));
            before = carried;
        });
    }
}

#[test]
fn only_new_triangles_are_sampled() {
    let mesh = square(7);
    let f = Counting(0.into());
    let fields: [&dyn Field; 2] = [&f, &Constant(1.0)];
    let mut before = load_pair(&mesh, fields).expect("finite");
    refined(mesh, |mesh, parent| {
        f.0.store(0, std::sync::atomic::Ordering::Relaxed);
        before = load_pair_carried(mesh, fields, &before, parent, 1).expect("finite");
        let bisected = |t: &usize| {
            let same = |s: usize| parent.get(s) == Some(&parent[*t]);
            same(t + 1) || (*t > 0 && same(t - 1))
        };
        let new = (0..mesh.triangle_count()).filter(bisected).count();
        let samples = f.0.load(std::sync::atomic::Ordering::Relaxed);
        // The last elements of every block are sampled eight at a time.
        let sampled: usize = fem_core::parallel::blocks(mesh.triangle_count())
            .map(|block| block.filter(bisected).count().next_multiple_of(8))
            .sum();
        assert_eq!(samples, 7 * sampled);
        assert!(new < mesh.triangle_count());
    });
}

#[test]
fn constants_are_stored_once() {
    let mesh = square(3);
    let [upper, lower] = load_pair(&mesh, [&Constant(2.0), &Constant(-0.5)]).expect("finite");
    assert_eq!((upper.same(), lower.same()), (Some(2.0), Some(-0.5)));
    assert_eq!((upper.mean(7), lower.deviation_squared(7)), (2.0, 0.0));
    assert!((total(&upper.nodal) - 8.0).abs() < 1e-14);
    let mixed = load_pair(&mesh, [&Constant(2.0), &|x: f64, _: f64| x]).expect("finite");
    assert_eq!((mixed[0].same(), mixed[1].same()), (Some(2.0), None));
    assert_eq!(mixed[0].nodal, upper.nodal);
    assert_eq!(
        means(&mesh, &Constant(3.0)).expect("finite").same(),
        Some(3.0)
    );
}
