//! MSH 2.2, ASCII and binary.
//!
//! `$Nodes`: a count, then rows `tag x y z`. `$Elements`: a count, then in ASCII rows
//! `tag type number-of-tags tags... nodes...`; in binary blocks of a header `type count
//! number-of-tags` and rows `tag tags... nodes...`. The first tag is the physical one.

use super::elements::{Kind, element_kind};
use super::error::GmshFault;
use super::region;
use super::scan::{Encoding, Scan, Scanner};
use super::soup::{Node, Soup, Triangle};

/// Reads what follows `$EndMeshFormat`.
pub(crate) fn read(scan: &mut Scanner<'_>) -> Scan<Soup> {
    let mut soup = Soup::default();
    let (mut nodes, mut elements) = (false, false);
    while let Some(section) = scan.section()? {
        match section {
            "Nodes" if nodes => {
                return Err(scan.flaw(GmshFault::RepeatedSection { section: "Nodes" }));
            }
            "Nodes" => {
                read_nodes(scan, &mut soup)?;
                nodes = true;
            }
            "Elements" if elements => {
                return Err(scan.flaw(GmshFault::RepeatedSection {
                    section: "Elements",
                }));
            }
            "Elements" => {
                read_elements(scan, &mut soup)?;
                elements = true;
            }
            "ParametricNodes" => return Err(scan.flaw(GmshFault::Parametric)),
            _ => scan.skip_section()?,
        }
    }
    for (found, section) in [(nodes, "Nodes"), (elements, "Elements")] {
        if !found {
            return Err(GmshFault::MissingSection { section }.into());
        }
    }
    Ok(soup)
}

fn read_nodes(scan: &mut Scanner<'_>, soup: &mut Soup) -> Scan<()> {
    let count = scan.count_line("the number of nodes")?;
    let count = scan.claim(count, 4 + 3 * 8, "nodes")?;
    soup.nodes.reserve_exact(count);
    for _ in 0..count {
        scan.begin_row();
        let at = scan.row_position();
        let tag = scan.tag("a node tag")?;
        let mut position = [0.0; 3];
        for x in &mut position {
            *x = scan.double("a coordinate")?;
        }
        scan.end_row()?;
        soup.nodes.push(Node {
            tag,
            position,
            tag_at: at,
            at,
        });
    }
    scan.end_section("Nodes")
}

fn read_elements(scan: &mut Scanner<'_>, soup: &mut Soup) -> Scan<()> {
    let count = scan.count_line("the number of elements")?;
    let count = scan.claim(count, 4 + 4, "elements")?;
    let mut done = 0;
    while done < count {
        scan.begin_row();
        match scan.encoding {
            Encoding::Ascii => {
                let tag = scan.tag("an element tag")?;
                let kind = read_kind(scan)?;
                let tags = read_tag_count(scan)?;
                read_element(scan, soup, tag, kind, tags)?;
                scan.end_row()?;
                done += 1;
            }
            Encoding::Binary { .. } => {
                let kind = read_kind(scan)?;
                let block = scan.int("a number of elements")?;
                let tags = read_tag_count(scan)?;
                let Some(block) = usize::try_from(block)
                    .ok()
                    .filter(|&n| n > 0 && n <= count - done)
                else {
                    let (what, found) = ("a number of elements", block.to_string());
                    return Err(scan.flaw(GmshFault::Number { what, found }));
                };
                for _ in 0..block {
                    scan.begin_row();
                    let tag = scan.tag("an element tag")?;
                    read_element(scan, soup, tag, kind, tags)?;
                }
                done += block;
            }
        }
    }
    scan.end_section("Elements")
}

fn read_kind(scan: &mut Scanner<'_>) -> Scan<Kind> {
    let kind = scan.int("an element type")?;
    element_kind(i64::from(kind)).map_err(|fault| scan.flaw(fault))
}

fn read_tag_count(scan: &mut Scanner<'_>) -> Scan<usize> {
    let what = "a number of tags";
    let count = scan.int(what)?;
    usize::try_from(count).map_err(|_| {
        let found = count.to_string();
        scan.flaw(GmshFault::Number { what, found })
    })
}

/// The tags and nodes of one element.
fn read_element(
    scan: &mut Scanner<'_>,
    soup: &mut Soup,
    tag: u64,
    kind: Kind,
    tags: usize,
) -> Scan<()> {
    let at = scan.row_position();
    let mut physical = 0;
    for k in 0..tags {
        let value = scan.int("a tag")?;
        if k == 0 {
            physical = value;
        }
    }
    let mut nodes = [0; 3];
    for k in 0..kind.nodes() {
        let node = scan.tag("a node tag")?;
        if kind == Kind::Triangle {
            nodes[k] = node;
        }
    }
    if kind == Kind::Triangle {
        soup.triangles.push(Triangle {
            tag,
            nodes,
            region: region(physical),
            at,
        });
    }
    Ok(())
}
