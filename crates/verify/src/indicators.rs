//! Estimators, energy and oscillation of a level, by plain sums over elements and edges. Everything is scaled.
//!
//! Beside every value stands the sum of the absolute values of its terms: that times the spacing of doubles is what rounding may
//! leave where they cancel.

use fem_core::Scale;
use fem_core::scale::{root_times_power_of_two, times_power_of_two};

use crate::action::nodal_action;
use crate::data::Discrete;
use crate::element::edges;
use crate::number::{Number, root_sum, sum};

/// Local values of an estimator with the size of their terms.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Local {
    /// The values.
    pub value: Vec<f64>,
    /// The sizes of what they are made of.
    pub terms: Vec<f64>,
}

impl Local {
    /// The root of the sum of squares.
    pub fn root(&self, exponent: i32) -> Number {
        Number::new(root_sum(&self.value), root_sum(&self.terms), exponent)
    }

    /// The plain sum.
    pub fn sum(&self, exponent: i32) -> Number {
        let total = |values: &[f64]| sum(values.iter().copied());
        Number::new(total(&self.value), total(&self.terms), exponent)
    }
}

/// The indicators of the paper.
#[derive(Clone, Debug)]
pub(crate) struct Paper {
    /// (7.1), one a triangle.
    pub eta_k: Local,
    /// (7.2), one an interior edge in the order of the mesh.
    pub eta_e: Local,
    /// (7.2) summed over the interior edges of a triangle, each counted half.
    pub eta_e_cell: Local,
}

/// Evaluates (7.1) and (7.2).
pub(crate) fn paper(level: &Discrete<'_>) -> Paper {
    let count = level.elements.len();
    // The stresses mu_1 grad u_1h - grad sigma_h, mu_2 grad u_2h + grad sigma_h, and grad sigma_h itself.
    let mut stress = [Vec::with_capacity(count), Vec::with_capacity(count)];
    let mut slope = Vec::with_capacity(count);
    let mut size = [Vec::with_capacity(count), Vec::with_capacity(count)];
    for (t, e) in level.elements.iter().enumerate() {
        let s = e.gradient(&level.sigma);
        slope.push(s);
        for (i, sign) in [(0, -1.0), (1, 1.0)] {
            let mu = level.tension[i][t];
            let g = e.gradient(&level.displacement[i]);
            stress[i].push([0, 1].map(|k| mu * g[k] + sign * s[k]));
            size[i].push([0, 1].map(|k| (mu * g[k]).abs() + s[k].abs()));
        }
    }
    let mut paper = Paper {
        eta_k: Local::default(),
        eta_e: Local::default(),
        eta_e_cell: Local {
            value: vec![0.0; count],
            terms: vec![0.0; count],
        },
    };
    for (t, e) in level.elements.iter().enumerate() {
        let mean = level.loads[0].mean(t).abs() + level.loads[1].mean(t).abs();
        let load = e.diameter * e.area.sqrt() * mean;
        paper.eta_k.value.push(load);
        paper.eta_k.terms.push(load);
    }
    for edge in edges(level.mesh) {
        let full = edge.jump(&stress[0]).0.abs() + edge.jump(&stress[1]).0.abs();
        let terms = edge.jump(&size[0]).1 + edge.jump(&size[1]).1;
        let (jump, jump_terms) = edge.jump(&slope);
        let positive = jump.max(0.0);
        paper.eta_e.value.push(positive);
        paper.eta_e.terms.push(jump_terms);
        for t in edge.sides {
            paper.eta_k.value[t] += full;
            paper.eta_k.terms[t] += terms;
            paper.eta_e_cell.value[t] += positive / 2.0;
            paper.eta_e_cell.terms[t] += jump_terms / 2.0;
        }
    }
    paper
}

/// The global bound (7.11) without its constant, and the same with its second term repaired; in the user's units, since their terms have
/// different ones.
///
/// ```text
/// (sum_K osc_K^2 + eta_K^2)^(1/2) + kappa^(1/2) (sum_e eta_e)^(1/2),    kappa = ||f_1|| + ||f_2||
/// (sum_K osc_K^2 + eta_K^2)^(1/2) + (sum_e h_e^2 [d_n sigma_h]_e^2)^(1/2) + (sum_j z_j (Pi w_h)_j)^(1/2)
/// ```
///
/// (Pi w_h)_j is the area-weighted mean of w_h over the triangles around j.
pub(crate) fn global_bound(
    level: &Discrete<'_>,
    paper: &Paper,
    oscillation: &Local,
) -> [Number; 2] {
    let scale = level.scale;
    let (eta, osc) = (root_sum(&paper.eta_k.value), root_sum(&oscillation.value));
    let kappa: f64 = level
        .loads
        .iter()
        .map(|load| {
            let squares = level
                .elements
                .iter()
                .enumerate()
                .map(|(t, e)| e.area * load.mean(t).powi(2) + load.deviation_squared(t));
            sum(squares).sqrt()
        })
        .sum();
    let slope: Vec<[f64; 2]> = level
        .elements
        .iter()
        .map(|e| e.gradient(&level.sigma))
        .collect();
    let jumps = sum(edges(level.mesh)
        .iter()
        .map(|edge| edge.jump(&slope).0.powi(2)))
    .sqrt();
    // The mean over the triangles around j, weighted by area: the dual area is a third of theirs.
    let mut around = vec![0.0; level.vertices()];
    for e in &level.elements {
        let mean = e.vertices.iter().map(|&j| level.gap(j)).sum::<f64>() / 3.0;
        for j in e.vertices {
            around[j] += e.area * mean;
        }
    }
    let overlap =
        sum((0..level.vertices()).map(|j| level.force[j] * around[j] / (3.0 * level.dual_area[j])));
    let force = |value: f64| times_power_of_two(value, scale.force());
    let first = force(eta.hypot(osc));
    let product = kappa * sum(paper.eta_e.value.iter().copied());
    let second = root_times_power_of_two(product, scale.load + scale.length + scale.force());
    let repaired = force(jumps) + times_power_of_two(overlap.max(0.0).sqrt(), scale.energy_norm());
    [first + second, first + repaired].map(|bound| Number::plain(bound, 0))
}

/// The residual estimator: roots, one a triangle.
///
/// ```text
/// eta_res,K^2 = sum_i [ h_K^2/mu_iK |K|/3 sum_{j in K} (f_ih +- l_j)^2 + 1/2 sum_e h_e^2 [mu_iK d_n u_ih]_e^2 / max(mu_iK, mu_iK') ] + c_K
/// c_K = sum_{j in K} l_j int_{K cap D_j} w_h,    the hat of j has the integral 11|K|/54 there and each other one 7|K|/108
/// ```
pub(crate) fn residual(level: &Discrete<'_>) -> Local {
    let action = nodal_action(level);
    let (mut squares, mut terms) = (Vec::new(), Vec::new());
    for (t, e) in level.elements.iter().enumerate() {
        let (mut square, mut size) = (0.0, 0.0);
        for (i, sign) in [(0, 1.0), (1, -1.0)] {
            let weight = e.diameter.powi(2) / level.tension[i][t] * e.area / 3.0;
            let f = level.loads[i].mean(t);
            for j in e.vertices {
                square += weight * (f + sign * action[j]).powi(2);
                size += weight * (f.abs() + action[j].abs()).powi(2);
            }
        }
        let mut contact = 0.0;
        for j in e.vertices {
            for k in e.vertices {
                let share = if j == k { 11.0 / 54.0 } else { 7.0 / 108.0 };
                contact += action[j] * share * e.area * level.gap(k);
            }
        }
        squares.push(square + contact.max(0.0));
        terms.push(size + contact.abs());
    }
    for i in 0..2 {
        let mu = &level.tension[i];
        let flux: Vec<[f64; 2]> = level
            .elements
            .iter()
            .enumerate()
            .map(|(t, e)| e.gradient(&level.displacement[i]).map(|g| mu[t] * g))
            .collect();
        for edge in edges(level.mesh) {
            let [s, t] = edge.sides;
            let stiffer = mu[s].max(mu[t]);
            let (jump, size) = edge.jump(&flux);
            for t in [s, t] {
                squares[t] += jump * jump / stiffer / 2.0;
                terms[t] += size * size / stiffer / 2.0;
            }
        }
    }
    let roots = |squares: Vec<f64>| squares.into_iter().map(f64::sqrt).collect();
    Local {
        value: roots(squares),
        terms: roots(terms),
    }
}

/// h_K (||f_1 - f_1h||_K^2 + ||f_2 - f_2h||_K^2)^(1/2), one a triangle.
pub(crate) fn oscillation(level: &Discrete<'_>) -> Local {
    let value = (0..level.elements.len()).map(|t| {
        let [a, b] = [0, 1].map(|i| level.loads[i].deviation_squared(t));
        level.elements[t].diameter * (a + b).sqrt()
    });
    Local {
        value: value.collect(),
        terms: vec![0.0; level.elements.len()],
    }
}

/// J(u_h) = sum_i 1/2 (mu_i grad u_ih, grad u_ih) - (f_i, u_ih), and |||u_h|||.
pub(crate) fn energy(level: &Discrete<'_>, scale: Scale) -> (Number, Number) {
    let (mut squares, mut work, mut terms) = (Vec::new(), Vec::new(), 0.0);
    for i in 0..2 {
        for (t, e) in level.elements.iter().enumerate() {
            let mu = level.tension[i][t];
            let [x, y] = e.gradient(&level.displacement[i]);
            squares.push(mu * e.area * (x * x + y * y));
        }
        let (u, load) = (&level.displacement[i], &level.loads[i].nodal);
        work.extend(u.iter().zip(load).map(|(u, f)| u * f));
    }
    let square = sum(squares);
    terms += square + sum(work.iter().map(|w| w.abs()));
    let energy = 0.5 * square - sum(work);
    (
        Number::new(energy, terms, scale.energy()),
        Number::plain(square.sqrt(), scale.energy_norm()),
    )
}
