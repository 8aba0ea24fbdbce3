//! The action as a function l_j: z_j / |D_j| inside, carried on to the boundary where the membranes touch there.
//!
//! A boundary vertex with a gap has 0, another the mean over its interior neighbours; one without interior neighbours (a corner) takes
//! the mean over the neighbours that have a value already, round by round.

use crate::data::Discrete;

/// l_j on all vertices.
pub(crate) fn nodal_action(level: &Discrete<'_>) -> Vec<f64> {
    let count = level.vertices();
    let around = neighbours(level);
    let mut value: Vec<Option<f64>> = (0..count)
        .map(|j| {
            level
                .is_interior(j)
                .then(|| level.force[j] / level.dual_area[j])
        })
        .collect();
    let mean = |j: usize, value: &[Option<f64>], counts: &dyn Fn(usize) -> bool| {
        let known: Vec<f64> = around[j]
            .iter()
            .filter(|&&k| counts(k))
            .filter_map(|&k| value[k])
            .collect();
        (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
    };
    let mut open: Vec<usize> = (0..count).filter(|&j| !level.is_interior(j)).collect();
    let first = |j: usize| {
        if level.gap(j) > 0.0 {
            Some(0.0)
        } else {
            mean(j, &value, &|k| level.is_interior(k))
        }
    };
    let mut found: Vec<(usize, Option<f64>)> = open.iter().map(|&j| (j, first(j))).collect();
    while found.iter().any(|(_, v)| v.is_some()) {
        for (j, v) in found {
            value[j] = v;
        }
        open.retain(|&j| value[j].is_none());
        found = open
            .iter()
            .map(|&j| (j, mean(j, &value, &|_| true)))
            .collect();
    }
    value.into_iter().map(|v| v.unwrap_or(0.0)).collect()
}

/// The vertices that share an edge with each.
fn neighbours(level: &Discrete<'_>) -> Vec<Vec<usize>> {
    let mut around = vec![Vec::with_capacity(8); level.vertices()];
    for e in &level.elements {
        for (k, &j) in e.vertices.iter().enumerate() {
            around[j].push(e.vertices[(k + 1) % 3]);
            around[j].push(e.vertices[(k + 2) % 3]);
        }
    }
    for list in &mut around {
        list.sort_unstable();
        list.dedup();
    }
    around
}
