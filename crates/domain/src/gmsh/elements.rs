//! Gmsh's element types: which are read, which are left out, which are refused.

use super::error::GmshFault;

/// What becomes of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A triangle with 3 nodes.
    Triangle,
    /// A point or line with so many nodes, left out.
    Lower(usize),
}

impl Kind {
    pub fn nodes(self) -> usize {
        match self {
            Self::Triangle => 3,
            Self::Lower(nodes) => nodes,
        }
    }
}

/// The type with Gmsh's number `kind`.
pub(crate) fn element_kind(kind: i64) -> Result<Kind, GmshFault> {
    let name = match kind {
        2 => return Ok(Kind::Triangle),
        15 => return Ok(Kind::Lower(1)),
        1 => return Ok(Kind::Lower(2)),
        8 => return Ok(Kind::Lower(3)),
        26..=28 => return Ok(Kind::Lower(kind as usize - 22)),
        62..=66 => return Ok(Kind::Lower(kind as usize - 55)),
        3 => "quadrangles",
        4 => "tetrahedra",
        5 => "hexahedra",
        6 => "prisms",
        7 => "pyramids",
        9 => "second-order triangles",
        10 | 16 => "second-order quadrangles",
        11 => "second-order tetrahedra",
        12 | 17 => "second-order hexahedra",
        13 | 18 => "second-order prisms",
        14 | 19 => "second-order pyramids",
        20 | 21 => "third-order triangles",
        22..=25 | 42..=46 | 52..=56 => "higher-order triangles",
        36..=41 | 47..=51 | 57..=61 => "higher-order quadrangles",
        29..=33 | 71..=75 | 79..=83 | 137 => "higher-order tetrahedra",
        34 | 69 => "polygons",
        35 => "polyhedra",
        92..=105 => "higher-order hexahedra",
        90 | 91 | 106..=117 => "higher-order prisms",
        118..=131 => "higher-order pyramids",
        84..=89 | 132 => "zeroth-order elements",
        67 | 70 => "border lines",
        68 => "border triangles",
        133..=136 | 138..=140 => "special elements",
        _ => "unknown elements",
    };
    Err(GmshFault::Element { name, kind })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_node_counts() {
        let name = |k| element_kind(k).unwrap_err().to_string();
        assert_eq!(name(9), "second-order triangles (type 9) are not supported");
        assert_eq!(name(3), "quadrangles (type 3) are not supported");
        assert_eq!(name(4), "tetrahedra (type 4) are not supported");
        assert_eq!(name(-1), "unknown elements (type -1) are not supported");
        assert_eq!(element_kind(2).unwrap(), Kind::Triangle);
        let nodes = |k| element_kind(k).unwrap().nodes();
        // Lines of order 1 to 10, and the point.
        let found = [1, 8, 26, 27, 28, 62, 63, 64, 65, 66].map(nodes);
        assert_eq!(found, [2, 3, 4, 5, 6, 7, 8, 9, 10, 11]);
        assert_eq!(nodes(15), 1);
    }
}
