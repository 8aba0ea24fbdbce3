//! The numbers of one level: a row of the history, in the user's units.

use contact::{DiscreteProblem, Reduction, Solution};
use estimate::{Energy, Grade, Squares};
use fem_core::Mesh;
use fem_core::scale::times_power_of_two;

use crate::assurance::Assurance;
use crate::estimates::{Estimates, bound_unit};
use crate::problem::Problem;
use crate::run::LevelError;
use crate::settings::{Estimator, Settings};

/// One level of a run. `None` does not apply. Units: see the field's formula in terms of lengths, tensions and loads;
/// numbers are those of the user's units, the scale is already put back.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelRecord {
    /// Number of the level, from 0.
    pub level: usize,
    /// Vertices, boundary included.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Size of the algebraic problem solved.
    pub unknowns: usize,
    /// Interior vertices of the contact set.
    pub contact_vertices: usize,
    /// Sum of their dual areas |D_j|.
    pub contact_area: f64,
    /// J(u_h).
    pub energy: f64,
    /// |||u_h|||.
    pub energy_norm: f64,
    /// Root of the sum of squares of (7.1).
    pub eta_k: Option<f64>,
    /// Plain sum of (7.2).
    pub eta_e_sum: Option<f64>,
    /// The global bound (7.11) without its constant.
    pub bound_711: Option<f64>,
    /// The same with a second term that converges.
    pub bound_711_repaired: Option<f64>,
    /// Residual estimator.
    pub residual: Option<f64>,
    /// The certificate: (B1).
    pub certified: Option<f64>,
    /// Its part for the algebraic error.
    pub eta_alg: Option<f64>,
    /// Estimate of the algebraic energy error that an iterative solver left; none for a direct one.
    pub algebraic_error: Option<f64>,
    /// What the certificate holds for.
    pub assurance: Option<Assurance>,
    /// Data oscillation.
    pub oscillation: f64,
    /// The number that the run is judged by.
    pub error_bound: f64,
    /// Which number that is: `rt0`, `rt1`, `predicted`, `residual` or `paper`.
    pub bound_kind: &'static str,
    /// error_bound / energy_norm; none when the norm is zero.
    pub relative_bound: Option<f64>,
    /// |||u - u_h|||.
    pub true_error: Option<f64>,
    /// error_bound / true_error; none when the error is zero.
    pub effectivity: Option<f64>,
    /// |sigma - sigma_h|_1.
    pub sigma_error: Option<f64>,
    /// (|u1 - u1h|_1^2 + |u2 - u2h|_1^2)^(1/2).
    pub h1_error: Option<f64>,
    /// Name of the solver.
    pub solver: &'static str,
    /// The model that was solved.
    pub reduction: Reduction,
    /// Its iterations.
    pub iterations: usize,
    /// Relative KKT residual.
    pub kkt_residual: f64,
    /// Sum of z_j.
    pub contact_force: f64,
    /// Largest pressure z_j / |D_j|.
    pub max_action: f64,
    /// Difference of contact_area and the area of the exact contact set.
    pub contact_area_error: Option<f64>,
    /// Area of both contact sets over that of either.
    pub contact_jaccard: Option<f64>,
    /// Hausdorff distance of the two contact sets; none when one of them is empty.
    pub contact_hausdorff: Option<f64>,
    /// Smallest gap u1 - u2 over all vertices.
    pub smallest_gap: f64,
    /// Wall seconds of refinement and transfer to this level.
    pub seconds_refine: f64,
    /// Wall seconds of loads and matrices.
    pub seconds_assemble: f64,
    /// Wall seconds of the solver.
    pub seconds_solve: f64,
    /// Wall seconds of estimators and true errors.
    pub seconds_estimate: f64,
    /// Wall seconds since the run began.
    pub seconds_total: f64,
    /// Peak resident memory so far, in MiB; none where the system does not tell.
    pub peak_memory_mb: Option<f64>,
}

impl LevelRecord {
    /// Puts the scale back: the numbers of a level in the user's units; its number, times and memory are left empty.
    pub(crate) fn of(
        mesh: &Mesh,
        discrete: &DiscreteProblem,
        solution: &Solution,
        estimates: &Estimates,
        problem: &Problem,
        settings: &Settings,
    ) -> Result<LevelRecord, LevelError> {
        let scale = problem.scale;
        let by = times_power_of_two;
        let bound_exponent = bound_unit(settings.estimate.estimator, scale);
        let certificate = estimates.certificate.as_ref();
        let bound_kind = match settings.estimate.estimator {
            Estimator::Certified if estimates.predicted => "predicted",
            Estimator::Certified => match certificate.map(|c| c.grade) {
                Some(Grade::Rt1) => "rt1",
                _ => "rt0",
            },
            Estimator::Residual => "residual",
            Estimator::Paper => "paper",
        };
        let Energy {
            energy,
            energy_norm: norm,
        } = estimates.energy;
        // A quotient of different units; the exponents are joined first, so that neither number can leave the range.
        let over = |number: f64| {
            (number != 0.0).then(|| {
                by(
                    estimates.bound / number,
                    bound_exponent - scale.energy_norm(),
                )
            })
        };
        let contact = Contact::of(discrete, solution);
        let errors = estimates.errors.as_ref();
        let assurance = match certificate {
            Some(certificate) => Some(Assurance::of(
                mesh,
                &discrete.tension_mean,
                problem,
                certificate,
            )?),
            None => None,
        };
        Ok(LevelRecord {
            level: 0,
            vertices: mesh.vertex_count(),
            triangles: mesh.triangle_count(),
            unknowns: solution.info.unknowns,
            contact_vertices: contact.vertices,
            contact_area: by(contact.area, scale.area()),
            energy: by(energy, scale.energy()),
            energy_norm: by(norm, scale.energy_norm()),
            eta_k: estimates
                .paper
                .as_ref()
                .map(|p| by(p.eta_k_total(), scale.force())),
            eta_e_sum: estimates
                .paper
                .as_ref()
                .map(|p| by(p.eta_e_sum(), scale.force())),
            bound_711: estimates.global_bound.map(|b| b.literal(scale)),
            bound_711_repaired: estimates.global_bound.map(|b| b.repaired(scale)),
            residual: estimates
                .residual
                .as_ref()
                .map(|r| by(r.total(), scale.energy_norm())),
            oscillation: by(
                estimates.oscillation.as_ref().map_or(0.0, Squares::total),
                scale.force(),
            ),
            error_bound: by(estimates.bound, bound_exponent),
            bound_kind,
            relative_bound: over(norm),
            true_error: errors.map(|e| by(e.energy, scale.energy_norm())),
            effectivity: errors.and_then(|e| over(e.energy)),
            sigma_error: errors.and_then(|e| e.sigma).map(|s| by(s, scale.force())),
            h1_error: errors.map(|e| by(e.h1_total, scale.displacement())),
            solver: solution.info.solver,
            reduction: solution.info.reduction,
            iterations: solution.info.iterations,
            kkt_residual: solution.info.kkt_residual,
            contact_force: by(contact.force, scale.force()),
            max_action: by(contact.pressure, scale.load),
            contact_area_error: estimates
                .contact_set
                .map(|c| by(c.area_error(), scale.area())),
            contact_jaccard: estimates.contact_set.map(|c| c.jaccard()),
            contact_hausdorff: estimates
                .contact_set
                .and_then(|c| c.hausdorff)
                .map(|d| by(d, scale.length)),
            smallest_gap: by(contact.gap, scale.displacement()),
            seconds_refine: 0.0,
            seconds_assemble: 0.0,
            seconds_solve: 0.0,
            seconds_estimate: 0.0,
            seconds_total: 0.0,
            peak_memory_mb: None,
            certified: certificate.map(|c| by(c.bound, scale.energy_norm())),
            algebraic_error: solution
                .info
                .algebraic_error
                .map(|e| by(e, scale.energy_norm())),
            eta_alg: certificate.map(|c| by(c.algebraic, scale.energy_norm())),
            assurance,
        })
    }
}

/// What the vertices tell of the contact, found in one pass; scaled.
struct Contact {
    /// Vertices of the contact set.
    vertices: usize,
    /// Sum of their dual areas.
    area: f64,
    /// Sum of all forces.
    force: f64,
    /// The largest force over dual area; not negative.
    pressure: f64,
    /// The smallest gap.
    gap: f64,
}

impl Contact {
    fn of(discrete: &DiscreteProblem, solution: &Solution) -> Contact {
        let mut contact = Contact {
            vertices: 0,
            area: 0.0,
            force: 0.0,
            pressure: 0.0,
            gap: f64::INFINITY,
        };
        let [upper, lower] = &solution.displacement;
        let forces = solution.force.iter().zip(&discrete.dual_area);
        for (((u1, u2), (force, area)), &touches) in
            upper.iter().zip(lower).zip(forces).zip(&solution.contact)
        {
            contact.gap = contact.gap.min(u1 - u2);
            if touches {
                contact.vertices += 1;
                contact.area += area;
            }
            if *force != 0.0 {
                contact.force += force;
                contact.pressure = contact.pressure.max(force / area);
            }
        }
        contact
    }
}
