//! The eleven cases of the reference files: tensions and exact gradients.

use std::ops::{Add, Mul};
use std::sync::Arc;

use estimate::{Exact, Gradient};
use fem_core::{Constant, Field};

/// A case of the reference files.
pub struct Case {
    /// Name of the files.
    pub file: &'static str,
    pub tension: [Arc<dyn Field>; 2],
    pub exact: Exact,
}

/// A value with its first derivatives.
#[derive(Clone, Copy)]
struct Jet([f64; 3]);

impl Add for Jet {
    type Output = Jet;
    fn add(self, b: Jet) -> Jet {
        Jet([0, 1, 2].map(|k| self.0[k] + b.0[k]))
    }
}

impl Mul for Jet {
    type Output = Jet;
    fn mul(self, b: Jet) -> Jet {
        let (Jet(a), Jet(b)) = (self, b);
        Jet([
            a[0] * b[0],
            a[1] * b[0] + a[0] * b[1],
            a[2] * b[0] + a[0] * b[2],
        ])
    }
}

impl Mul<Jet> for f64 {
    type Output = Jet;
    fn mul(self, b: Jet) -> Jet {
        Jet(b.0.map(|v| self * v))
    }
}

fn constant(v: f64) -> Jet {
    Jet([v, 0.0, 0.0])
}

/// The coordinates as jets.
fn xy(x: f64, y: f64) -> (Jet, Jet) {
    (Jet([x, 1.0, 0.0]), Jet([y, 0.0, 1.0]))
}

/// (1 - x^2)(1 - y^2).
fn bubble(x: Jet, y: Jet) -> Jet {
    (constant(1.0) + -1.0 * x * x) * (constant(1.0) + -1.0 * y * y)
}

/// The distance to (a, b) squared minus a radius squared.
fn circle(x: Jet, y: Jet, center: [f64; 2], radius: f64) -> Jet {
    let (dx, dy) = (x + constant(-center[0]), y + constant(-center[1]));
    dx * dx + dy * dy + constant(-radius * radius)
}

/// max(c, 0)^2: leaves zero with a jump in the second derivatives.
fn positive_square(c: Jet) -> Jet {
    if c.0[0] > 0.0 { c * c } else { constant(0.0) }
}

fn gradient(f: impl Fn(Jet, Jet) -> Jet + Clone + Send + Sync + 'static) -> Gradient {
    let g = f.clone();
    let at = |f: &dyn Fn(Jet, Jet) -> Jet, x, y| {
        let (x, y) = xy(x, y);
        f(x, y)
    };
    [
        Arc::new(move |x, y| at(&f, x, y).0[1]),
        Arc::new(move |x, y| at(&g, x, y).0[2]),
    ]
}

fn case(
    file: &'static str,
    tension: [f64; 2],
    u1: impl Fn(Jet, Jet) -> Jet + Clone + Send + Sync + 'static,
    u2: impl Fn(Jet, Jet) -> Jet + Clone + Send + Sync + 'static,
) -> Case {
    Case {
        file,
        tension: tension.map(|m| Arc::new(Constant(m)) as Arc<dyn Field>),
        exact: Exact {
            displacement: [gradient(u1), gradient(u2)],
            sigma: None,
            action: None,
            contact: None,
        },
    }
}

fn disk() -> Case {
    let u1 = |x, y| 0.1 * circle(x, y, [0.0; 2], 0.0);
    let u2 = move |x: Jet, y: Jet| {
        let c = circle(x, y, [0.0; 2], 0.5f64.sqrt());
        u1(x, y) + -0.2 * positive_square(c)
    };
    let slope = |x: f64, y: f64| {
        let square = x * x + y * y;
        if square > 0.5 {
            -1.0 / (40.0 * square)
        } else {
            -1.0 / 20.0
        }
    };
    let mut case = case("P1_disk_8_4", [1.0, 1.0], u1, u2);
    case.exact.sigma = Some([
        Arc::new(move |x, y| x * slope(x, y)),
        Arc::new(move |x, y| y * slope(x, y)),
    ]);
    case
}

/// Factors of z^3, z^7, ... in the harmonic part of the square's sigma; the further ones are 2^-(4k+2).
const SQUARE_SERIES: [f64; 10] = [
    0.2954261252019279,
    0.014546099241970863,
    0.0009916840928903428,
    6.079593529631831e-05,
    3.818418149611794e-06,
    2.3836035748410963e-07,
    1.4902070637509424e-08,
    9.313083635360603e-10,
    5.82078829572084e-11,
    3.637975337641525e-12,
];

fn square_sigma(x: f64, y: f64) -> [f64; 2] {
    let r2 = x * x + y * y;
    let radial = if r2 > 0.25 {
        -5.0 / (16.0 * r2)
    } else {
        5.0 * r2 - 2.5
    };
    let times = |a: [f64; 2], b: [f64; 2]| [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
    let second = times([x, y], [x, y]);
    let (third, fourth) = (times(second, [x, y]), times(second, second));
    let (mut power, mut sum) = (third, [0.0; 2]);
    for k in 1..=24 {
        let factor = SQUARE_SERIES
            .get(k - 1)
            .copied()
            .unwrap_or_else(|| 0.5f64.powi(4 * k as i32 + 2));
        sum[0] -= factor * power[0];
        sum[1] += factor * power[1];
        power = times(power, fourth);
    }
    [
        radial * x + 5.0 / 16.0 * sum[0],
        radial * y + 5.0 / 16.0 * sum[1],
    ]
}

fn square() -> Case {
    let u = |factor: f64| {
        move |x, y| {
            let c = circle(x, y, [0.0; 2], 0.5);
            bubble(x, y) * (constant(1.0 / 3.0) + factor * positive_square(c))
        }
    };
    let mut case = case("P2_right_16", [1.0, 2.0], u(2.0 / 3.0), u(-1.0 / 3.0));
    case.exact.sigma = Some([
        Arc::new(|x, y| square_sigma(x, y)[0]),
        Arc::new(|x, y| square_sigma(x, y)[1]),
    ]);
    case
}

/// r^(2/3) sin(2 theta / 3) around the corner of the L.
fn corner(x: Jet, y: Jet) -> Jet {
    let (x, y) = (x.0[0], y.0[0]);
    let theta = 0.75 * std::f64::consts::PI + f64::atan2(-(x + y), y - x);
    let r2 = x * x + y * y;
    let slope = 2.0 / 3.0 * r2.powf(-1.0 / 6.0);
    Jet([
        r2.cbrt() * (2.0 / 3.0 * theta).sin(),
        slope * (-theta / 3.0).sin(),
        slope * (-theta / 3.0).cos(),
    ])
}

fn lshape() -> Case {
    let u = |factor: f64| {
        move |x, y| {
            let c = circle(x, y, [-0.5, 0.5], 0.25);
            let height = constant(1.0 / 3.0) + factor * positive_square(c);
            bubble(x, y) * height * corner(x, y)
        }
    };
    case("P3_lshape_16", [1.0, 2.0], u(2.0 / 3.0), u(-1.0 / 3.0))
}

fn smooth_tensions() -> Case {
    let u = |factor: f64| {
        move |x, y| {
            let c = circle(x, y, [0.1, -0.2], 0.4);
            bubble(x, y) * (constant(1.0) + factor * positive_square(c))
        }
    };
    let mut case = case("P4a_delaunay_24", [1.0; 2], u(0.5), u(-0.5));
    case.tension = [
        Arc::new(|x: f64, y: f64| (3.0 * x).sin() * (2.0 * y).cos() / 2.0 + 1.0),
        Arc::new(|x: f64, y: f64| (x * y + y).exp()),
    ];
    case
}

fn tension_jump() -> Case {
    let mu = |x: f64| if x > 0.0 { 1e4 } else { 1.0 };
    let u = move |factor: f64| {
        move |x: Jet, y: Jet| {
            let c = circle(x, y, [0.0; 2], 0.4);
            let tilt = constant(1.0) + 0.5 / mu(x.0[0]) * x;
            bubble(x, y) * (tilt + factor * positive_square(c))
        }
    };
    let mut case = case("P4b_cross_8", [1.0; 2], u(0.5), u(-0.5));
    case.tension = [
        Arc::new(move |x: f64, _: f64| mu(x)),
        Arc::new(move |x: f64, _: f64| 2.0 * mu(x)),
    ];
    case
}

fn point_contact() -> Case {
    let u = |factor: f64, rest: f64| {
        move |x: Jet, y: Jet| {
            let a = 5.0 * x * x + -1.0 * x + 5.0 * y * y + -2.0 * y;
            bubble(x, y) * (factor * a + constant(rest))
        }
    };
    let upper = u(8.0 / 15.0, 7.0 / 15.0);
    case(
        "P7_delaunay_16",
        [1.0, 2.0],
        upper,
        u(-4.0 / 15.0, 4.0 / 15.0),
    )
}

fn cusp() -> Case {
    let u = |factor: f64| {
        move |x: Jet, y: Jet| {
            let b = x + constant(0.5);
            let c = y * y + -1.0 * (constant(0.5) + -1.0 * x) * b * b * b;
            bubble(x, y) * (constant(0.5) + factor * positive_square(c))
        }
    };
    case("P7c_cross_12", [1.0, 1.0], u(2.0), u(-2.0))
}

fn off_centre() -> Case {
    let u = |factor: f64| {
        move |x, y| {
            let c = circle(x, y, [0.23, -0.17], 0.41);
            bubble(x, y) * (constant(0.5) + factor * positive_square(c))
        }
    };
    case("P8_delaunay_24", [1.0, 1.0], u(0.5), u(-0.5))
}

/// All cases, in the order of their names.
pub fn all() -> Vec<Case> {
    let mut full = case("P6c_right_16", [1.0, 3.0], bubble, bubble);
    full.exact.sigma = Some(gradient(bubble));
    vec![
        disk(),
        square(),
        lshape(),
        smooth_tensions(),
        tension_jump(),
        case("P5_delaunay_16", [1.0, 1.0], bubble, |x, y| {
            -2.0 * bubble(x, y)
        }),
        case("P6_cross_8", [1.0, 3.0], bubble, bubble),
        full,
        point_contact(),
        cusp(),
        off_centre(),
    ]
}
