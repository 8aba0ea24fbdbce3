//! The observer that writes a run's files.

use std::borrow::Cow;
use std::time::Instant;

use fem_core::scale::times_power_of_two;
use fem_core::{InteriorEdge, Scale};
use serde_json::{Map, Value};

use crate::level::Level;
use crate::output::{
    EdgeFields, Ending, LevelFields, OutputError, RunFolder, Summary, Values, peak_memory_mb,
};
use crate::record::LevelRecord;
use crate::run::{Observer, Reason};
use crate::settings::{Fields, Output};

/// Writes the scene and history as the run goes, the fields of the levels that are asked for, and the summary at the end.
pub struct Recorder {
    folder: RunFolder,
    scene_text: String,
    output: Output,
    scale: Scale,
    levels: Vec<LevelRecord>,
    written: Option<usize>,
    seconds: f64,
    begun: Instant,
}

impl Recorder {
    /// A recorder for one run. Nothing is written before the first level is finished.
    ///
    /// `scene_text` is the scene as it is run, with every override applied.
    pub fn new(folder: RunFolder, scene_text: String, output: Output, scale: Scale) -> Recorder {
        Recorder {
            folder,
            scene_text,
            output,
            scale,
            levels: Vec::new(),
            written: None,
            seconds: 0.0,
            begun: Instant::now(),
        }
    }

    /// The levels seen so far.
    pub fn levels(&self) -> &[LevelRecord] {
        &self.levels
    }

    /// The folder of the run.
    pub fn folder(&self) -> &RunFolder {
        &self.folder
    }

    /// Writes the summary and returns it.
    ///
    /// # Errors
    /// What could not be written.
    pub fn finish(&mut self, ending: Finish) -> Result<Value, OutputError> {
        let mut additions = ending.additions;
        let sums = self.folder.checksums().iter();
        let sums: Map<String, Value> = sums
            .map(|(name, sum)| (name.clone(), sum.as_str().into()))
            .collect();
        additions.insert("checksums".into(), sums.into());
        let summary = Summary {
            ending: ending.ending,
            stopped_by: ending.stopped_by,
            exit_code: ending.exit_code,
            scene: ending.scene,
            title: ending.title,
            levels: &self.levels,
            wall_seconds: self.begun.elapsed().as_secs_f64(),
            seconds_output: self.seconds,
            peak_memory_mb: peak_memory_mb(),
            additions,
        };
        self.folder.write_summary(&summary)?;
        Ok(summary.to_json())
    }

    fn write_fields(&mut self, level: &Level) -> Result<(), OutputError> {
        if self.written == Some(level.number) {
            return Ok(());
        }
        self.written = Some(level.number);
        self.folder.write_level(fields(level, self.scale))?;
        if let (true, Some(paper)) = (self.output.edges, &level.estimates.paper) {
            let edges: Vec<_> = level
                .mesh
                .interior_edges()
                .map(|e: InteriorEdge| e.vertices)
                .collect();
            self.folder.write_edges(EdgeFields {
                level: level.number,
                error_bound: level.record.error_bound,
                points: scaled_points(level, self.scale),
                edges: Cow::Owned(edges),
                eta_e: by(&paper.eta_e, self.scale.force()),
            })?;
        }
        Ok(())
    }

    fn timed(
        &mut self,
        write: impl FnOnce(&mut Self) -> Result<(), OutputError>,
    ) -> Result<(), OutputError> {
        let clock = Instant::now();
        let result = write(self);
        self.seconds += clock.elapsed().as_secs_f64();
        result
    }
}

/// What the end of a run adds to its summary.
pub struct Finish {
    /// How it ended.
    pub ending: Ending,
    /// The rule that ended it, or the failure.
    pub stopped_by: String,
    /// Exit code of the program.
    pub exit_code: i32,
    /// Name of the scene file.
    pub scene: String,
    /// Title of the scene.
    pub title: Option<String>,
    /// Whatever else is to be told.
    pub additions: Map<String, Value>,
}

impl Observer for Recorder {
    fn level(&mut self, level: &Level, last: Option<Reason>) -> Result<(), OutputError> {
        self.timed(|this| {
            if this.levels.is_empty() {
                this.folder.begin()?;
                this.folder.write_scene(&this.scene_text)?;
            }
            this.levels.push(level.record.clone());
            this.folder.write_history(&this.levels)?;
            if this.output.wants_fields(level.number, last.is_some()) {
                this.write_fields(level)?;
            }
            Ok(())
        })
    }

    fn failed(&mut self, last_good: &Level) -> Result<(), OutputError> {
        if self.output.fields == Fields::None {
            return Ok(());
        }
        self.timed(|this| this.write_fields(last_good))
    }
}

fn by(values: &[f64], exponent: i32) -> Cow<'_, [f64]> {
    if exponent == 0 {
        return Cow::Borrowed(values);
    }
    Cow::Owned(
        values
            .iter()
            .map(|&v| times_power_of_two(v, exponent))
            .collect(),
    )
}

fn scaled_points(level: &Level, scale: Scale) -> Cow<'_, [[f64; 2]]> {
    if scale.length == 0 {
        return Cow::Borrowed(level.mesh.points());
    }
    Cow::Owned(
        level
            .mesh
            .points()
            .iter()
            .map(|p| p.map(|x| times_power_of_two(x, scale.length)))
            .collect(),
    )
}

/// The fields of a level in the user's units, which are computed while they are written.
pub fn fields(level: &Level, scale: Scale) -> LevelFields<'_> {
    let (solution, discrete, estimates) = (&level.solution, &level.discrete, &level.estimates);
    let count = level.mesh.vertex_count();
    let by = Values::scaled;
    let gap = move |j| times_power_of_two(solution.gap(j), scale.displacement());
    let action =
        move |j: usize| times_power_of_two(solution.force[j] / discrete.dual_area[j], scale.load);
    let triangles = level.mesh.triangle_count();
    let mean = |i: usize| {
        let load = &discrete.loads[i];
        move |t| times_power_of_two(load.mean(t), scale.load)
    };
    let oscillation = move |t: usize| {
        let square = estimates
            .oscillation
            .as_ref()
            .map_or(0.0, |o| o.squares()[t]);
        times_power_of_two(square.sqrt(), scale.force())
    };
    let paper = estimates.paper.as_ref();
    LevelFields {
        level: level.number,
        error_bound: level.record.error_bound,
        points: Values::scaled_points(level.mesh.points(), scale.length),
        triangles: level.mesh.triangles().into(),
        u1: by(&solution.displacement[0], scale.displacement()),
        u2: by(&solution.displacement[1], scale.displacement()),
        gap: Values::by(count, gap),
        sigma: by(&solution.sigma, scale.force()),
        action_force: by(&solution.force, scale.force()),
        action: Values::by(count, action),
        contact: solution.contact.as_slice().into(),
        eta_k: paper.map(|p| by(&p.eta_k, scale.force())),
        eta_e: paper.map(|p| by(&p.eta_e_cell, scale.force())),
        residual: estimates.residual.as_ref().map(|r| {
            let root =
                move |t: usize| times_power_of_two(r.squares()[t].sqrt(), scale.energy_norm());
            Values::by(triangles, root)
        }),
        certified: estimates
            .certificate
            .as_ref()
            .map(|c| by(&c.local, scale.energy_norm())),
        oscillation: Some(Values::by(triangles, oscillation)),
        f1_h: Values::by(triangles, mean(0)),
        f2_h: Values::by(triangles, mean(1)),
        generation: level.mesh.generation().into(),
        region: level.mesh.region().into(),
    }
}
