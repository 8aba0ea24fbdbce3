//! One level: its files against what follows from its mesh, its nodal fields and the scene.

use adapt::output::folder::{edges_file, level_file};
use adapt::settings::Estimator;
use fem_core::scale::times_power_of_two;
use fem_core::{FieldError, Mesh};
use scene::Scene;

use crate::certificate::Place;
use crate::columns::Recomputed;
use crate::conditions;
use crate::cover;
use crate::data::{Discrete, Nodal};
use crate::element::edges;
use crate::error::{LevelError, VerifyError};
use crate::fields::{EdgeFields, LevelFields};
use crate::folder::Folder;
use crate::number::{Number, ROUNDING, TOLERANCE, largest};
use crate::report::{Claim, Report};
use crate::sigma;
use crate::vtk::VtkFile;

/// What is known of the file of a level.
pub(crate) struct LevelFile {
    /// Its arrays.
    fields: LevelFields,
    /// Its mesh, scaled.
    mesh: Mesh,
}

/// Parses a file; `None` if it is missing (which is reported elsewhere) or was changed so that it cannot be parsed.
fn parse(
    folder: &Folder,
    name: &str,
    kind: &str,
    report: &mut Report,
) -> Result<Option<VtkFile>, VerifyError> {
    let Some(content) = folder.read(name)? else {
        return Ok(None);
    };
    match VtkFile::parse(&content.bytes, kind) {
        Ok(file) => Ok(Some(file)),
        Err(why) if content.genuine => Err(VerifyError::Unreadable {
            path: folder.path(name),
            why,
        }),
        Err(why) => {
            report.property(name, "format", Some(why));
            Ok(None)
        }
    }
}

/// Reads the fields of a level and builds its mesh; `None` where that is not possible, with the reason in the report.
///
/// # Errors
/// A file that cannot be read though it is as it was written.
pub(crate) fn read(
    folder: &Folder,
    number: usize,
    scene: &Scene,
    report: &mut Report,
) -> Result<Option<LevelFile>, VerifyError> {
    let name = level_file(number);
    let Some(file) = parse(folder, &name, "UnstructuredGrid", report)? else {
        return Ok(None);
    };
    let built = LevelFields::of(&file).and_then(|fields| {
        let mesh = mesh(&fields, scene)?;
        Ok(LevelFile { fields, mesh })
    });
    match built {
        Ok(level) => {
            report.property(&name, "fields", level.fields.lost_digits());
            Ok(Some(level))
        }
        Err(why) => {
            report.property(&name, "fields", Some(why.to_string()));
            Ok(None)
        }
    }
}

/// The mesh of a file in the scene's scaled units.
fn mesh(fields: &LevelFields, scene: &Scene) -> Result<Mesh, LevelError> {
    let wrong = |what: String| LevelError::File(what);
    let scale = scene.problem.scale;
    let points: Vec<[f64; 2]> = fields
        .points
        .iter()
        .map(|p| p.map(|x| times_power_of_two(x, -scale.length)))
        .collect();
    let region: Result<Vec<i32>, _> = fields.region.iter().map(|&r| i32::try_from(r)).collect();
    let region = region.map_err(|_| wrong("a region is no 32-bit integer".into()))?;
    let mesh = Mesh::with_refinement_edges(
        points,
        &fields.triangles,
        &region,
        scene.problem.mesh.curve(),
    )
    .map_err(|e| wrong(e.to_string()))?;
    // A mesh turns clockwise triangles; a run writes none.
    let same = |(read, kept): (&[u32; 3], &[fem_core::VertexId; 3])| *read == kept.map(|v| v.0);
    match fields
        .triangles
        .iter()
        .zip(mesh.triangles())
        .position(|t| !same(t))
    {
        Some(t) => Err(wrong(format!("triangle {t} is not counter-clockwise"))),
        None => Ok(mesh),
    }
}

impl LevelFile {
    /// The data of the scene on the mesh, and the nodal fields of the file, scaled.
    ///
    /// # Errors
    /// A value of the data that is not finite.
    pub fn discrete<'a>(
        &'a self,
        scene: &'a Scene,
        place: Place<'_>,
    ) -> Result<Discrete<'a>, FieldError> {
        let problem = &scene.problem;
        let scaled = |values: &[f64], exponent: i32| -> Vec<f64> {
            let by = |&v: &f64| times_power_of_two(v, -exponent);
            values.iter().map(by).collect()
        };
        let fields = &self.fields;
        let displacement = problem.scale.displacement();
        let force = problem.scale.force();
        let nodal = Nodal {
            displacement: [0, 1].map(|i| scaled(&fields.displacement[i], displacement)),
            force: scaled(&fields.force, force),
            sigma: scaled(&fields.sigma, force),
            contact: fields.contact.iter().map(|&c| c != 0).collect(),
        };
        Discrete::new(&self.mesh, problem, nodal, place.has(&scene.settings))
    }

    /// Compares mesh and arrays of the file.
    pub fn check(&self, level: &Recomputed<'_>, scene: &Scene, report: &mut Report) {
        let name = level_file(level.level);
        let (fields, discrete, scale) = (&self.fields, level.discrete, level.scale);
        report.same(&name, "level", fields.level, level.level as i64);
        if let Some(bound) = level.bound() {
            report.number(&name, "error_bound", fields.error_bound, bound);
        }
        let flags = |j: usize| {
            let flag = fields.contact[j];
            (!matches!(flag, 0 | 1)).then(|| (flag.to_string(), None))
        };
        report.everywhere(
            &name,
            "contact is 0 or 1",
            "vertex",
            fields.contact.len(),
            flags,
        );
        cover::check(
            &self.mesh,
            &scene.problem.mesh,
            &fields.generation,
            &name,
            report,
        );
        conditions::check(discrete, &name, report);
        sigma::check(discrete, &name, report);

        let count = discrete.vertices();
        let gap: Vec<f64> = (0..count).map(|j| discrete.gap(j)).collect();
        let action: Vec<f64> = (0..count)
            .map(|j| discrete.force[j] / discrete.dual_area[j])
            .collect();
        let point = |claim: &'static str, claimed, recomputed, exponent| Claim {
            file: &name,
            name: claim,
            place: "vertex",
            claimed,
            recomputed,
            exponent,
        };
        // A difference of two numbers that are both there has no rounding but its own.
        let ends = |j: usize| discrete.displacement[0][j].abs() + discrete.displacement[1][j].abs();
        let claim = point("gap", &fields.gap, &gap, scale.displacement());
        report.values(&claim, |j| 2.0 * f64::EPSILON * ends(j));
        report.array(
            &point("action", &fields.action, &action, scale.load),
            |_| 0.0,
        );

        let paper = level.paper.as_ref();
        let energy = scale.energy_norm();
        let certificate = level.certificate.as_ref();
        let means = discrete.loads.each_ref().map(|f| {
            (0..discrete.elements.len())
                .map(|t| f.mean(t))
                .collect::<Vec<f64>>()
        });
        let none: &[f64] = &[];
        for (claim, local, exponent) in [
            (
                "eta_K",
                paper.map(|p| (&p.eta_k.value[..], &p.eta_k.terms[..])),
                scale.force(),
            ),
            (
                "eta_e",
                paper.map(|p| (&p.eta_e_cell.value[..], &p.eta_e_cell.terms[..])),
                scale.force(),
            ),
            (
                "residual",
                level
                    .residual
                    .as_ref()
                    .map(|l| (&l.value[..], &l.terms[..])),
                energy,
            ),
            (
                "certified",
                certificate.map(|c| (&c.local.value[..], &c.local.terms[..])),
                energy,
            ),
            (
                "oscillation",
                Some((&level.oscillation.value[..], none)),
                scale.force(),
            ),
            ("f1_h", Some((&means[0][..], none)), scale.load),
            ("f2_h", Some((&means[1][..], none)), scale.load),
        ] {
            match (fields.cell(claim), local) {
                (Some(claimed), Some((recomputed, terms))) => {
                    let array = Claim {
                        file: &name,
                        name: claim,
                        place: "triangle",
                        claimed,
                        recomputed,
                        exponent,
                    };
                    report.array(&array, |t| ROUNDING * terms.get(t).copied().unwrap_or(0.0));
                }
                (None, None) => report.property(&name, claim, None),
                (None, Some(_)) => {
                    report.property(&name, claim, Some("the array is missing".into()))
                }
                (Some(_), None) => {
                    let wrong = "the array was not asked for or is not recomputed by this version";
                    report.property(&name, claim, Some(wrong.into()));
                }
            }
        }
    }

    /// Compares the edge file of the level, if the scene asks for one.
    ///
    /// # Errors
    /// A file that cannot be read though it is as it was written.
    pub fn check_edges(
        &self,
        level: &Recomputed<'_>,
        folder: &Folder,
        report: &mut Report,
    ) -> Result<(), VerifyError> {
        let wanted = level.settings.output.edges && level.settings.estimate.wants(Estimator::Paper);
        let (true, Some(paper)) = (wanted, &level.paper) else {
            return Ok(());
        };
        let name = edges_file(level.level);
        let Some(file) = parse(folder, &name, "PolyData", report)? else {
            return Ok(());
        };
        let fields = match EdgeFields::of(&file) {
            Ok(fields) => fields,
            Err(why) => {
                report.property(&name, "fields", Some(why.to_string()));
                return Ok(());
            }
        };
        report.same(&name, "level", fields.level, level.level as i64);
        if let Some(bound) = level.bound() {
            report.number(&name, "error_bound", fields.error_bound, bound);
        }
        let points = (fields.points != self.fields.points)
            .then(|| "they are not those of the level".to_owned());
        report.property(&name, "points", points);
        let expected = edges(&self.mesh);
        let same = expected.len() == fields.edges.len()
            && expected
                .iter()
                .zip(&fields.edges)
                .all(|(e, read)| e.ends.iter().zip(read).all(|(&end, &v)| end == v as usize));
        let wrong = (!same).then(|| "they are not the interior edges of the level".to_owned());
        report.property(&name, "connectivity", wrong);
        if same {
            let claim = Claim {
                file: &name,
                name: "eta_e",
                place: "edge",
                claimed: &fields.eta_e,
                recomputed: &paper.eta_e.value,
                exponent: level.scale.force(),
            };
            report.array(&claim, |e| ROUNDING * paper.eta_e.terms[e]);
        }
        Ok(())
    }
}

/// How far the mean of a tension may vary and still be called constant, or the quotient of two and still be called a ratio.
const SAME: f64 = 1e-13;

/// The model that a level was solved as: by its contact set, else by the tensions.
pub(crate) fn reduction(level: &Recomputed<'_>) -> &'static str {
    let d = level.discrete;
    if !level.settings.solve.reduce {
        return "two-field";
    }
    let contact = d.in_contact().count();
    if contact == 0 {
        return "no-contact";
    }
    let interior = (0..d.vertices()).filter(|&j| d.is_interior(j)).count();
    if contact == interior && crate::columns::shares_boundary(d) {
        return "full-contact";
    }
    let [a, b] = [&d.tension[0], &d.tension[1]];
    let [a, b] = [a, b].map(|m| (0..d.elements.len()).map(|t| m[t]).collect::<Vec<f64>>());
    let constant = |m: &[f64]| m.iter().all(|&v| v == m[0]);
    let ratio = b[0] / a[0];
    if constant(&a) && constant(&b) {
        "constant-tensions"
    } else if a
        .iter()
        .zip(b)
        .all(|(a, b)| ((b / a) / ratio - 1.0).abs() <= SAME)
    {
        "constant-ratio"
    } else {
        "two-field"
    }
}

/// What the loads hide from the bound, and the floor of a relative goal: see [`crate::ending`].
pub(crate) struct Unseen {
    /// The oscillation of the loads in the unit of the bound.
    pub oscillation: Number,
    /// The largest contribution of the loads to the estimator.
    pub contribution: f64,
}

/// Evaluates [`Unseen`].
pub(crate) fn unseen(level: &Recomputed<'_>) -> Unseen {
    let d = level.discrete;
    let (mut square, mut squares) = (0.0, Vec::new());
    for (t, e) in d.elements.iter().enumerate() {
        let over = |i: usize, value: f64| value / level.weight(i, t);
        // The certificate sees everything.
        let part = |i: usize| over(i, d.loads[i].deviation_squared(t));
        if level.settings.estimate.estimator != Estimator::Certified {
            square += e.diameter.powi(2) * (part(0) + part(1));
        }
        let mean = |i: usize| over(i, d.loads[i].mean(t).powi(2));
        squares.push(e.diameter.powi(2) * e.area * (mean(0) + mean(1)));
    }
    Unseen {
        oscillation: Number {
            value: square.sqrt(),
            slack: TOLERANCE * square.sqrt(),
            exponent: 0,
        },
        contribution: largest(&squares).sqrt(),
    }
}
