//! MSH 4.1, ASCII and binary.
//!
//! The values are parsed by [`mshio`]. A survey goes first, because that parser
//!
//! - forgets the node tags where it believes them consecutive, whatever their order,
//! - has no notion of lines, and reads across them,
//! - panics on data sizes it does not know, and computes `0 - 1` for an empty section.
//!
//! The survey walks through the rows of `$Nodes` and `$Elements`, refuses what is not supported,
//! and notes the node tags and the place of every node and triangle.

use std::collections::HashMap;

use mshio::{ElementType, MshFile};

use super::elements::{Kind, element_kind};
use super::error::{Flaw, GmshFault, Place};
use super::region;
use super::scan::{Encoding, Scan, Scanner};
use super::soup::{Node, Soup, Triangle};
use crate::MeshDefect;

/// What the survey notes; one entry a block of the file.
#[derive(Debug, Default)]
struct Survey {
    node_blocks: Vec<NodeBlock>,
    /// Places of the elements; empty for blocks of points and lines.
    element_blocks: Vec<Vec<usize>>,
}

#[derive(Debug, Default)]
struct NodeBlock {
    tags: Vec<u64>,
    tags_at: Vec<usize>,
    at: Vec<usize>,
}

/// Reads `bytes`, a whole file, with `scan` behind its `$EndMeshFormat`.
pub(crate) fn read(scan: &mut Scanner<'_>, bytes: &[u8]) -> Scan<Soup> {
    let survey = survey(scan)?;
    let file = mshio::parse_msh_bytes(bytes).map_err(|error| {
        let kind = error.first_msh_error();
        let context = error
            .filter_msh_errors()
            .find_map(|(_, kind)| kind.context());
        let what = match (kind, context) {
            (Some(kind), Some(context)) if kind.context().is_none() => {
                format!("{kind} ({context})")
            }
            (Some(kind), _) => kind.to_string(),
            (None, _) => "syntax error".to_string(),
        };
        // The parser's rest is a part of `bytes`; where it starts is where it stopped.
        let at = error.backtrace.first().map_or(0, |(rest, _)| {
            (rest.as_ptr() as usize).wrapping_sub(bytes.as_ptr() as usize)
        });
        Flaw {
            place: place(scan, bytes, at),
            fault: GmshFault::Parser {
                what: what.trim_end_matches('.').to_string(),
            },
        }
    })?;
    combine(survey, file).ok_or_else(|| {
        let what = "blocks are not where their sizes say".to_string();
        GmshFault::Parser { what }.into()
    })
}

fn place(scan: &Scanner<'_>, bytes: &[u8], at: usize) -> Place {
    match (bytes.get(..at), scan.encoding) {
        (None, _) => Place::File,
        (Some(before), Encoding::Ascii) => {
            Place::Line(1 + before.iter().filter(|&&b| b == b'\n').count())
        }
        (Some(_), Encoding::Binary { .. }) => Place::Byte(at),
    }
}

fn survey(scan: &mut Scanner<'_>) -> Scan<Survey> {
    let mut survey = Survey::default();
    let (mut nodes, mut elements, mut entities) = (false, false, false);
    while let Some(section) = scan.section()? {
        let (seen, section) = match section {
            "Nodes" => {
                if !nodes {
                    survey_nodes(scan, &mut survey)?;
                }
                (&mut nodes, "Nodes")
            }
            "Elements" => {
                if !elements {
                    survey_elements(scan, &mut survey)?;
                }
                (&mut elements, "Elements")
            }
            "Entities" => {
                scan.skip_section()?;
                (&mut entities, "Entities")
            }
            "PartitionedEntities" => return Err(scan.flaw(GmshFault::Partitioned)),
            _ => {
                scan.skip_section()?;
                continue;
            }
        };
        if std::mem::replace(seen, true) {
            return Err(scan.flaw(GmshFault::RepeatedSection { section }));
        }
    }
    for (found, section) in [(nodes, "Nodes"), (elements, "Elements")] {
        if !found {
            return Err(GmshFault::MissingSection { section }.into());
        }
    }
    Ok(survey)
}

/// The header of `$Nodes` or `$Elements`: how many blocks, how many items.
fn section_header(scan: &mut Scanner<'_>) -> Scan<(u64, u64)> {
    scan.begin_row();
    let blocks = scan.size("a number of blocks")?;
    let items = scan.size("a total number")?;
    scan.size("the smallest tag")?;
    scan.size("the largest tag")?;
    scan.end_row()?;
    if items == 0 {
        // The next parser would take the number of gaps, one less, for huge.
        let defect = MeshDefect::NoTriangles;
        let message = defect.to_string();
        return Err(GmshFault::Defect { defect, message }.into());
    }
    Ok((blocks, items))
}

fn survey_nodes(scan: &mut Scanner<'_>, survey: &mut Survey) -> Scan<()> {
    let (blocks, total) = section_header(scan)?;
    scan.claim(total, 8 + 3 * 8, "nodes")?;
    let blocks = scan.claim(blocks, 3 * 4 + 8, "blocks of nodes")?;
    for _ in 0..blocks {
        scan.begin_row();
        scan.int("a dimension")?;
        scan.int("an entity tag")?;
        let parametric = scan.int("the parametric flag")?;
        let count = scan.size("a number of nodes")?;
        scan.end_row()?;
        if parametric != 0 {
            return Err(scan.flaw(GmshFault::Parametric));
        }
        let count = scan.claim(count, 8 + 3 * 8, "nodes")?;
        let mut block = NodeBlock::default();
        for _ in 0..count {
            scan.begin_row();
            block.tags_at.push(scan.row_position());
            block.tags.push(scan.size("a node tag")?);
            scan.end_row()?;
        }
        for _ in 0..count {
            scan.begin_row();
            block.at.push(scan.row_position());
            for _ in 0..3 {
                scan.double("a coordinate")?;
            }
            scan.end_row()?;
        }
        survey.node_blocks.push(block);
    }
    scan.end_section("Nodes")
}

fn survey_elements(scan: &mut Scanner<'_>, survey: &mut Survey) -> Scan<()> {
    let (blocks, total) = section_header(scan)?;
    scan.claim(total, 2 * 4, "elements")?;
    let blocks = scan.claim(blocks, 3 * 4 + 4, "blocks of elements")?;
    for _ in 0..blocks {
        scan.begin_row();
        scan.int("a dimension")?;
        scan.int("an entity tag")?;
        let kind = scan.int("an element type")?;
        let kind = element_kind(i64::from(kind)).map_err(|fault| scan.flaw(fault))?;
        let count = scan.size("a number of elements")?;
        scan.end_row()?;
        let count = scan.claim(count, 4 * (1 + kind.nodes()), "elements")?;
        let mut at = Vec::new();
        for _ in 0..count {
            scan.begin_row();
            if kind == Kind::Triangle {
                at.push(scan.row_position());
            }
            scan.size("an element tag")?;
            for _ in 0..kind.nodes() {
                scan.size("a node tag")?;
            }
            scan.end_row()?;
        }
        survey.element_blocks.push(at);
    }
    scan.end_section("Elements")
}

/// Puts tags and places to the parsed values; `None` where the two disagree about the blocks.
fn combine(survey: Survey, file: MshFile<u64, i32, f64>) -> Option<Soup> {
    let (nodes, elements) = (file.data.nodes?, file.data.elements?);
    let mut regions = HashMap::new();
    for surface in file.data.entities.iter().flat_map(|e| &e.surfaces) {
        let physical = surface.physical_tags.first().copied().unwrap_or(0);
        regions.insert(surface.tag, region(physical));
    }
    let mut soup = Soup::default();
    if survey.node_blocks.len() != nodes.node_blocks.len()
        || survey.element_blocks.len() != elements.element_blocks.len()
    {
        return None;
    }
    for (noted, block) in survey.node_blocks.iter().zip(&nodes.node_blocks) {
        if noted.tags.len() != block.nodes.len() {
            return None;
        }
        for (k, node) in block.nodes.iter().enumerate() {
            soup.nodes.push(Node {
                tag: noted.tags[k],
                position: [node.x, node.y, node.z],
                tag_at: noted.tags_at[k],
                at: noted.at[k],
            });
        }
    }
    for (at, block) in survey.element_blocks.iter().zip(elements.element_blocks) {
        if block.element_type != ElementType::Tri3 {
            continue;
        }
        if at.len() != block.elements.len() {
            return None;
        }
        let region = regions.get(&block.entity_tag).copied().unwrap_or(0);
        for (&at, element) in at.iter().zip(&block.elements) {
            soup.triangles.push(Triangle {
                tag: element.element_tag,
                nodes: element.nodes.as_slice().try_into().ok()?,
                region,
                at,
            });
        }
    }
    Some(soup)
}
