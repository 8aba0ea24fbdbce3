//! A problem does not depend on the units in which its scene is written: powers of two leave every bit alone.

use std::path::Path;

use adapt::Problem;
use fem_core::scale::times_power_of_two;
use fem_core::{Field, Samples, Scale, TriangleId};
use scene::from_text;

/// x = 2^a X, mu = 4^k M, f = 2^l F, and heights to match.
#[derive(Clone, Copy, Debug)]
struct Units {
    a: i32,
    k: i32,
    l: i32,
}

impl Units {
    fn displacement(self) -> i32 {
        self.l + 2 * self.a - 2 * self.k
    }

    fn force(self) -> i32 {
        self.l + 2 * self.a
    }

    /// The scene in these units. `X` and `Y` stand for coordinates in the first ones, `L(..)` for a length and so on.
    fn scene(self, shape: &str) -> Problem {
        let factor = |e: i32| format!("{:e}", times_power_of_two(1.0, e));
        let mut text = shape.to_owned();
        text.push_str(
            "[upper]\ntension = \"MU*if(X > 0.1, 3.7, 2.1 + X*Y/4)\"\nload = \"LOAD*(X^3 - 0.3*Y)\"\nboundary = \"U*(0.3 + X/8)\"\n\
             [lower]\ntension = \"0.37*MU\"\nload = \"-LOAD*if(X^2 + Y^2 < 0.5, 0.1, Y)\"\nboundary = \"U*(0.1*Y - 2)\"\n\
             [exact]\nupper = \"U*(X^2*Y - X)\"\nlower = \"U*X*Y\"\naction = \"LOAD*X^2\"\nsigma = \"FORCE*(X*Y^3)\"\ncontact = \"X > 0.2\"\n",
        );
        for (name, e) in [
            ("LOAD", self.l),
            ("FORCE", self.force()),
            ("MU", 2 * self.k),
            ("U", self.displacement()),
        ] {
            text = text.replace(&format!("\"{name}*"), &format!("\"{}*", factor(e)));
            text = text.replace(&format!("-{name}*"), &format!("-{}*", factor(e)));
            text = text.replace(&format!("*{name}\""), &format!("*{}\"", factor(e)));
        }
        for name in ["X", "Y"] {
            let coordinate = format!("({}*{})", name.to_lowercase(), factor(-self.a));
            text = text.replace(name, &coordinate);
        }
        let mut rest = String::new();
        for (i, part) in text.split("L(").enumerate() {
            match part.split_once(')') {
                Some((number, after)) if i > 0 => {
                    let value: f64 = number.parse().expect("a length");
                    rest.push_str(&format!("{:e}{after}", times_power_of_two(value, self.a)));
                }
                _ => rest.push_str(part),
            }
        }
        from_text(&rest, "scene.toml", Path::new(""), &[])
            .unwrap_or_else(|e| panic!("{e}\n{rest}"))
            .problem
    }
}

/// Values of a field at the centres of all triangles.
fn values(problem: &Problem, field: &dyn Field) -> Vec<u64> {
    let mesh = &problem.mesh;
    let centres: Vec<[f64; 2]> = (0..mesh.triangle_count() as u32)
        .map(|t| {
            let [a, b, c] = mesh.corners(TriangleId(t));
            [0, 1].map(|k| 0.25 * a[k] + 0.25 * b[k] + 0.5 * c[k])
        })
        .collect();
    let x: Vec<f64> = centres.iter().map(|p| p[0]).collect();
    let y: Vec<f64> = centres.iter().map(|p| p[1]).collect();
    let region = vec![0.0; x.len()];
    let mut out = vec![0.0; x.len()];
    let at = Samples {
        x: &x,
        y: &y,
        region: &region,
    };
    field.sample(at, &mut out).unwrap_or_else(|e| panic!("{e}"));
    out.iter().map(|v| v.to_bits()).collect()
}

fn same(base: &Problem, other: &Problem, units: Units) {
    let expected = Scale {
        length: base.scale.length + units.a,
        tension: base.scale.tension + 2 * units.k,
        load: base.scale.load + units.l,
    };
    assert_eq!(other.scale, expected, "{units:?}");
    assert_eq!(base.mesh.points(), other.mesh.points(), "{units:?}");
    assert_eq!(base.mesh.triangles(), other.mesh.triangles());
    assert_eq!(base.mesh.curve(), other.mesh.curve());
    let fields = |problem: &Problem| -> Vec<Vec<u64>> {
        let exact = problem.exact.as_ref().expect("an exact solution");
        let mut all: Vec<&dyn Field> = Vec::new();
        for list in [&problem.tension, &problem.load, &problem.height] {
            all.extend(list.iter().map(|f| &**f));
        }
        let sigma = exact.sigma.as_ref().expect("sigma");
        all.extend(
            exact
                .displacement
                .iter()
                .chain([sigma])
                .flatten()
                .map(|f| &**f),
        );
        all.extend(
            [&exact.action, &exact.contact]
                .into_iter()
                .flatten()
                .map(|f| &**f),
        );
        assert_eq!(all.len(), 14);
        all.into_iter()
            .map(|field| values(problem, field))
            .collect()
    };
    for (k, (one, two)) in fields(base).iter().zip(&fields(other)).enumerate() {
        assert_eq!(one, two, "field {k} in {units:?}");
    }
}

fn covariant(shape: &str) {
    let base = Units { a: 0, k: 0, l: 0 }.scene(shape);
    for (a, k, l) in [
        (1, 0, 0),
        (0, 1, 0),
        (0, 0, 1),
        (-7, 3, -11),
        (60, -90, 130),
        (-200, 100, 300),
        (250, -150, -200),
    ] {
        let units = Units { a, k, l };
        same(&base, &units.scene(shape), units);
    }
}

#[test]
fn rectangle() {
    covariant(
        "[domain.rectangle]\nlower = [L(-0.7), L(0.1)]\nupper = [L(1.3), L(1.2)]\nsize = L(0.3)\n",
    );
}

#[test]
fn disk() {
    covariant("[domain.disk]\ncenter = [L(0.2), L(-0.1)]\nradius = L(0.9)\n");
}

#[test]
fn polygon() {
    covariant(
        "[domain.polygon]\nouter = [[L(0), L(0)], [L(1.7), L(0.1)], [L(1.1), L(1.3)], [L(-0.2), L(0.9)]]\n\
         holes = [[[L(0.5), L(0.4)], [L(0.8), L(0.5)], [L(0.6), L(0.7)]]]\nlines = [[[L(1.1), L(0.6)], [L(1.2), L(0.8)]]]\nsize = L(0.25)\n",
    );
}

#[test]
fn everything_inside_is_of_order_one() {
    let shape = "[domain.disk]\ncenter = [L(0.2), L(-0.1)]\nradius = L(0.9)\n";
    for (a, k, l) in [(0, 0, 0), (-200, 100, 300)] {
        let problem = Units { a, k, l }.scene(shape);
        let largest = |fields: &[&dyn Field]| {
            let all = fields.iter().flat_map(|field| values(&problem, *field));
            all.map(|bits| f64::from_bits(bits).abs())
                .fold(0.0, f64::max)
        };
        let mu = largest(&problem.tensions());
        assert!((1.0..4.0).contains(&mu), "{mu}");
        let f = largest(&problem.loads());
        let g = largest(&[&*problem.height[0], &*problem.height[1]]);
        assert!(f < 2.0 && g < 2.0 && f.max(g) > 0.1, "{f} {g}");
    }
}
