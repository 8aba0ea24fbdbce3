//! Counts the steps of multigrid on the last mesh of adaptive runs: the same code for the tests in `steps.rs` and for the bench `steps`, which goes on to
//! larger meshes.

use std::path::Path;
use std::sync::Arc;

use adapt::output::OutputError;
use adapt::settings::{Estimate, Estimator, Final, Stop};
use adapt::{Before, Level, Problem, Reason, Settings};
use contact::{Cycles, DiscreteProblem, Solution, Solver, Start, Tolerance, Workspace};
use estimate::certificate::POINCARE;
use estimate::{Certificate, Grade, Moments};
use fem_core::{Children, Mesh, TriangleId};

/// What is promised of a case.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Group {
    /// Constant tensions, few contact sets.
    Smooth,
    /// Constant tensions, thousands of contact spots.
    Spots,
    /// Two fields; the tensions are smooth, or jump along one line of edges.
    TwoFields,
    /// Two fields with a checkerboard of tensions.
    Checkerboard,
}

impl Group {
    /// The largest number of steps to a relative KKT residual of 1e-10 from the solution of the mesh before.
    pub fn most(self) -> usize {
        match self {
            Group::Smooth => 8,
            Group::Spots => 13,
            Group::TwoFields => 20,
            Group::Checkerboard => 45,
        }
    }
}

/// A problem whose steps are counted.
#[derive(Clone)]
pub struct Case {
    /// What tables call it.
    pub name: &'static str,
    /// What is promised.
    pub group: Group,
    /// The scene: domain and data.
    scene: String,
}

const SQUARE: &str = "[domain.rectangle]\nlower = [-1, -1]\nupper = [1, 1]\nsize = 0.25\n";
const DISK: &str = "[domain.disk]\ncenter = [0, 0]\nradius = 1\nsize = 0.25\n";
const LSHAPE: &str =
    "[domain.polygon]\nouter = [[-1, -1], [0, -1], [0, 0], [1, 0], [1, 1], [-1, 1]]\nsize = 0.35\n";

/// A wave presses and pulls: many contact sets.
const ISLANDS: &str = "60*sin(4*pi*x)*sin(4*pi*y) - 15";

/// Random on 64 by 64 cells: thousands of contact spots. The number of a cell is the fraction of a large sine.
const SPOTS: &str = "100*(43758.5453*sin(12.9898*floor(32*(x + 1)) + 78.233*floor(32*(y + 1))) \
    - floor(43758.5453*sin(12.9898*floor(32*(x + 1)) + 78.233*floor(32*(y + 1)))) - 0.6)";

/// Smooth tensions between 1/9 and 9.
const SMOOTH: &str = "exp(2.2*sin(3*x)*cos(2*y))";

/// A jump by 1e4 across a line of edges.
const INTERFACE: &str = "if(x > 0, 10000, 1)";

/// A checkerboard of 8 by 8 cells, along the edges of the initial mesh.
const BOARD: &str = "if(floor(4*x) + floor(4*y) == 2*floor((floor(4*x) + floor(4*y))/2), 1, 100)";

/// The same with the other colour.
const OTHER_BOARD: &str =
    "if(floor(4*x) + floor(4*y) == 2*floor((floor(4*x) + floor(4*y))/2), 100, 1)";

impl Case {
    fn new(name: &'static str, group: Group, domain: &str, data: &str) -> Case {
        Case {
            name,
            group,
            scene: format!("{domain}{data}"),
        }
    }

    /// A case of `tests/cases/`.
    fn known(name: &'static str, domain: &str) -> Case {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/cases");
        let data = std::fs::read_to_string(root.join(format!("{name}.toml"))).expect("a case");
        Case::new(name, Group::Smooth, domain, &data)
    }

    /// The upper membrane under `load`, held at height 0.1, above one without load, held at 0.
    fn pressed(name: &'static str, group: Group, tensions: [&str; 2], load: &str) -> Case {
        let membrane = |name: &str, tension: &str, load: &str, height: f64| {
            format!("[{name}]\ntension = \"{tension}\"\nload = \"{load}\"\nboundary = {height}\n")
        };
        let upper = membrane("upper", tensions[0], load, 0.1);
        let lower = membrane("lower", tensions[1], "0", 0.0);
        Case::new(name, group, SQUARE, &(upper + &lower))
    }

    /// Re-entrant corner, constant loads.
    fn corner() -> Case {
        let data = "[upper]\ntension = 1\nload = -6\nboundary = 0.05\n\
                    [lower]\ntension = 2\nload = 0\nboundary = 0\n";
        Case::new("L-shape", Group::Smooth, LSHAPE, data)
    }

    /// The cases that are counted.
    pub fn all() -> Vec<Case> {
        let two = |name, group, upper, lower| Case::pressed(name, group, [upper, lower], ISLANDS);
        vec![
            Case::known("P1", DISK),
            Case::known("P2", SQUARE),
            Case::known("P3", LSHAPE),
            Case::known("P7", SQUARE),
            Case::known("P8", SQUARE),
            Case::corner(),
            Case::pressed("islands", Group::Smooth, ["1", "1"], ISLANDS),
            Case::pressed("spots", Group::Spots, ["1", "1"], SPOTS),
            two("smooth tensions", Group::TwoFields, SMOOTH, "1"),
            two("interface, upper", Group::TwoFields, INTERFACE, "1"),
            two("interface, lower", Group::TwoFields, "1", INTERFACE),
            two("checkerboard, upper", Group::Checkerboard, BOARD, "1"),
            two("checkerboards", Group::Checkerboard, BOARD, OTHER_BOARD),
        ]
    }

    /// Whether the mesh can be refined towards the origin, where a corner or a jump is.
    pub fn deepens(&self) -> bool {
        ["L-shape", "interface, upper"].contains(&self.name)
    }

    /// The problem, without its known solution, and settings: residual estimator, no files, a marked triangle divided as told.
    fn load(&self, children: Children) -> (Problem, Settings) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("scene.toml");
        std::fs::write(&file, &self.scene).expect("written");
        let scene = scene::load(&file, &[]).unwrap_or_else(|e| panic!("{e}\n{}", self.scene));
        let mut problem = scene.problem;
        problem.exact = None;
        let mut settings = scene.settings;
        settings.estimate = Estimate {
            estimator: Estimator::Residual,
            also: Vec::new(),
            last: Final::Fast,
        };
        settings.mark.children = children;
        (problem, settings)
    }
}

/// What was counted on one mesh.
#[derive(Clone, Debug)]
pub struct Counts {
    /// Vertices.
    pub vertices: usize,
    /// Levels of bisection.
    pub depth: u16,
    /// From the solution of the mesh before to a relative KKT residual of 1e-10. A mean is solved to rounding then.
    pub nested: Cycles,
    /// Steps after which all fields together have that residual, if none is solved further than the others.
    pub enough: usize,
    /// The largest factor of the energy norm of the algebraic error in the last steps of all fields.
    pub contraction: f64,
    /// From nothing to the same residual; `None` where the active set method took over.
    pub cold: Option<Cycles>,
    /// After one step from the solution of the mesh before: energy norm of the difference to the solution, over a fifth of the residual estimator, which is
    /// about the error.
    pub one: f64,
    /// Steps from the same start after which eta_alg is at most a tenth of eta, if the certificate was wanted.
    pub settled: Option<usize>,
    /// Steps that the run itself took on this mesh.
    pub run: usize,
}

impl Counts {
    /// Steps from nothing over those of the nested start: the largest quotient of the fields. Infinite where the active set method took over.
    pub fn cold_over_nested(&self) -> f64 {
        let Some(cold) = &self.cold else {
            return f64::INFINITY;
        };
        let gap = |c: &Cycles| (c.inequality + c.monotone) as f64;
        let mean = cold.mean as f64 / self.nested.mean.max(1) as f64;
        mean.max(gap(cold) / gap(&self.nested))
    }

    /// The head of a table.
    pub const HEAD: &'static str = "| case | vertices | depth | steps: gap or both, mean | to 1e-10, limit | contraction | cold: steps + monotone, mean | cold over nested | \
         error after one step | steps to eta_alg <= eta/10 | steps of the run |\n|---|---|---|---|---|---|---|---|---|---|---|";

    /// A row of the table.
    pub fn row(&self, case: &Case) -> String {
        let nested = &self.nested;
        let settled = self.settled.map_or("-".to_owned(), |n| n.to_string());
        let cold = self.cold.map_or("active set | -".to_owned(), |c| {
            let (gap, quotient) = (c.inequality, self.cold_over_nested());
            format!("{gap} + {}, {} | {quotient:.2}", c.monotone, c.mean)
        });
        format!(
            "| {} | {} | {} | {}, {} | {}, {} | {:.3} | {cold} | {:.4} | {settled} | {} |",
            case.name,
            self.vertices,
            self.depth,
            nested.inequality,
            nested.mean,
            self.enough,
            case.group.most(),
            self.contraction,
            self.one,
            self.run
        )
    }
}

/// Steps of all fields of a model, which run side by side.
fn steps(solution: &Solution) -> usize {
    let cycles = solution.info.cycles.unwrap_or_default();
    (cycles.inequality + cycles.monotone).max(cycles.mean)
}

/// Multigrid without sigma.
fn multigrid(tolerance: Tolerance, energy_target: Option<f64>) -> contact::Settings {
    contact::Settings {
        solver: Solver::Multigrid,
        tolerance,
        energy_target,
        sigma: false,
        ..contact::Settings::default()
    }
}

/// The start told that one step is worth looking at by itself: with a target that everything meets, one step is made.
fn trusted(start: &Start) -> Start {
    Start {
        first_cycle: Some(0.5),
        ..start.clone()
    }
}

/// The energy norm of the difference of two solutions.
fn energy_difference(discrete: &DiscreteProblem, a: &Solution, b: &Solution) -> f64 {
    let mesh = &*discrete.mesh;
    let mut sum = 0.0;
    for t in mesh.triangle_ids() {
        let shape = mesh.shape(t);
        for i in 0..2 {
            let corners = mesh.triangles()[t.index()];
            let [x, y] = [a, b].map(|s| &s.displacement[i]);
            let g = shape.gradient(corners.map(|v| x[v.index()] - y[v.index()]));
            sum += discrete.tension_mean[i][t.index()] * shape.area * (g[0] * g[0] + g[1] * g[1]);
        }
    }
    sum.sqrt()
}

/// The certificate of a solution.
fn certificate(
    problem: &Problem,
    discrete: &DiscreteProblem,
    moments: &Moments,
    solution: &Solution,
) -> Certificate {
    let given = adapt::given(problem, discrete, moments, solution);
    estimate::certify(&given, Grade::Rt0, POINCARE).expect("good data")
}

/// A mesh to count on.
struct Place<'a> {
    problem: &'a Problem,
    discrete: &'a DiscreteProblem,
    start: &'a Start,
    /// Steps that the loop made there.
    run: usize,
}

impl Place<'_> {
    /// Solves again and again, from the start and from nothing.
    fn count(&self, certified: bool) -> Counts {
        let &Place {
            discrete, start, ..
        } = self;
        let mut workspace = Workspace::default();
        let mut by = |tolerance, target, start: Option<&Start>| -> Solution {
            let settings = multigrid(tolerance, target);
            contact::solve_in(discrete, &settings, start, &mut workspace).expect("solved")
        };
        let tight = Tolerance::Relative(1e-10);
        let nested = by(tight, None, Some(start));
        assert_eq!(nested.info.solver, "multigrid", "{:?}", nested.info);
        assert!(nested.info.kkt_residual <= 1e-10, "{:?}", nested.info);

        // A target in the energy norm tells nothing of a residual: go down until it is there.
        let mut target = 10.0 * nested.info.algebraic_error.expect("an estimate");
        let enough = loop {
            let s = by(Tolerance::Balanced, Some(target), Some(start));
            if s.info.kkt_residual <= 1e-10 {
                break steps(&s);
            }
            target *= 0.3;
        };

        let first = trusted(start);
        let one = by(Tolerance::Balanced, Some(f64::INFINITY), Some(&first));
        drop(first);
        let made = one.info.cycles.expect("cycles");
        assert_eq!((made.inequality, made.monotone), (1, 0));
        assert!(made.mean <= 1);
        let sweep = estimate::sweep(&discrete.mesh, discrete, &one, true, 1);
        let size = 0.2 * sweep.residual.expect("wanted").total();
        let error = energy_difference(discrete, &one, &nested);

        let cold = by(tight, None, None);
        let settled = certified.then(|| {
            let by_target = |target| by(Tolerance::Balanced, Some(target), Some(start));
            self.settle(one, by_target)
        });
        let depth = discrete.mesh.genealogy().iter().map(|b| b.level).max();
        Counts {
            vertices: discrete.order(),
            depth: depth.unwrap_or(0),
            nested: nested.info.cycles.expect("cycles"),
            enough,
            contraction: nested.info.contraction.expect("several steps"),
            cold: cold.info.cycles.filter(|_| cold.info.solver == "multigrid"),
            one: error / size,
            settled,
            run: self.run,
        }
    }

    /// Steps until eta_alg is a tenth of eta: lower and lower targets from the same start, the first of them met by `s`.
    fn settle(&self, mut s: Solution, mut by_target: impl FnMut(f64) -> Solution) -> usize {
        let moments = adapt::moments(self.problem, self.discrete).expect("good data");
        loop {
            let found = certificate(self.problem, self.discrete, &moments, &s);
            if found.algebraic <= 0.1 * found.eta {
                return steps(&s);
            }
            let algebraic = s.info.algebraic_error.expect("an estimate");
            s = by_target(0.07 * algebraic * found.eta / found.algebraic);
        }
    }
}

/// How a case is run.
#[derive(Clone, Copy)]
pub struct How {
    /// How far a marked triangle is divided.
    pub children: Children,
    /// Whether eta_alg is looked at: the certificate costs more than all solves.
    pub certified: bool,
}

/// What a run left on every mesh that multigrid solved: its vertices, and the energy norm of the difference to the solution, over a fifth
/// of the residual estimator.
pub fn left_by_a_run(case: &Case, theta: f64, vertices: usize) -> Vec<(usize, f64)> {
    let (problem, mut settings) = case.load(Children::Four);
    settings.mark.theta = theta;
    settings.stop = Stop {
        vertices: Some(vertices),
        ..Stop::default()
    };
    let mut left = Vec::new();
    let mut watch = |level: &Level, _: Option<Reason>| -> Result<(), OutputError> {
        let (discrete, solution) = (&level.discrete, &level.solution);
        if solution.info.cycles.is_some() {
            let tight = multigrid(Tolerance::Relative(1e-10), None);
            let again = Start::again(solution);
            let exact = contact::solve(discrete, &tight, Some(&again)).expect("solved");
            let residual = level.estimates.residual.as_ref().expect("wanted").total();
            let error = energy_difference(discrete, solution, &exact);
            left.push((discrete.order(), error / (0.2 * residual)));
        }
        Ok(())
    };
    adapt::run(&problem, &settings, &mut watch).unwrap_or_else(|e| panic!("{e}"));
    left
}

/// Runs a case, and counts on the first mesh with as many vertices as each of `sizes`, which grow.
pub fn along_a_run(case: &Case, how: How, sizes: &[usize], mut see: impl FnMut(Counts)) {
    let (problem, mut settings) = case.load(how.children);
    settings.stop = Stop {
        vertices: sizes.last().copied(),
        ..Stop::default()
    };
    let mut sizes = sizes.iter().peekable();
    let mut before: Option<(Solution, usize)> = None;
    let mut watch = |level: &Level, _: Option<Reason>| -> Result<(), OutputError> {
        let vertices = level.mesh.vertex_count();
        let mut wanted = false;
        while sizes.next_if(|&&size| size <= vertices).is_some() {
            wanted = true;
        }
        if let Some((solution, old)) = before.take().filter(|_| wanted) {
            let start = Start::prolong(&solution, &level.mesh, old);
            let place = Place {
                problem: &problem,
                discrete: &level.discrete,
                start: &start,
                run: steps(&level.solution),
            };
            see(place.count(how.certified));
        }
        before = Some((level.solution.clone(), vertices));
        Ok(())
    };
    adapt::run(&problem, &settings, &mut watch).unwrap_or_else(|e| panic!("{e}"));
}

/// One step on every mesh of an adaptive loop, and what was counted on the first with so many vertices. A mesh with 2000 vertices or less is solved until its
/// contact set stands. Elements at the origin alone are bisected before, until the mesh has `depth` levels there.
pub fn by_single_steps(case: &Case, how: How, vertices: usize, depth: u16) -> Counts {
    let (problem, settings) = case.load(how.children);
    let mut mesh = Arc::new(problem.mesh.clone());
    let mut discrete = adapt::discretise(&problem, &mesh, 1).expect("good data");
    let mut start: Option<Start> = None;
    let mut workspace = Workspace::default();
    loop {
        let levels = mesh.genealogy().iter().map(|b| b.level).max();
        let deep = levels >= Some(depth);
        if let Some(start) = start.as_ref().filter(|_| deep)
            && mesh.vertex_count() >= vertices
        {
            let place = Place {
                problem: &problem,
                discrete: &discrete,
                start,
                run: 1,
            };
            return place.count(how.certified);
        }
        let target = start.as_ref().map(|_| f64::INFINITY);
        let solve = multigrid(Tolerance::Balanced, target);
        let solution =
            contact::solve_in(&discrete, &solve, start.as_ref(), &mut workspace).expect("solved");
        let made = solution.info.cycles.map_or(0, |c| c.inequality.max(c.mean));
        assert!(made <= 1 || discrete.order() <= 2000, "{made} steps");
        let (marked, children) = if deep {
            let sweep = estimate::sweep(&mesh, &discrete, &solution, true, 1);
            let squares = sweep.residual.expect("wanted");
            let marked = adapt::mark(squares.squares(), &settings.mark);
            (marked, settings.mark.children)
        } else {
            (at_the_origin(&mesh), Children::Two)
        };
        let (refined, refinement) = mesh.refined_on(&marked, children, 1).expect("refines");
        let carried = Start::prolong(&solution, &refined, refinement.old_vertices);
        start = Some(trusted(&carried));
        mesh = Arc::new(refined);
        let before = Before {
            discrete: &discrete,
            parent: &refinement.parent,
        };
        discrete = adapt::discretise_carried(&problem, &mesh, before, 1).expect("good data");
    }
}

/// Triangles with a vertex at the origin.
fn at_the_origin(mesh: &Mesh) -> Vec<TriangleId> {
    let here = |t: &TriangleId| mesh.corners(*t).contains(&[0.0, 0.0]);
    mesh.triangle_ids().filter(here).collect()
}
