//! Writes meshes in every Gmsh format that is read.
#![allow(dead_code)]

use domain::RawMesh;

/// How to write.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Format {
    Ascii,
    Little,
    Big,
}

pub const FORMATS: [Format; 3] = [Format::Ascii, Format::Little, Format::Big];

/// A growing file.
struct Out {
    bytes: Vec<u8>,
    format: Format,
    fresh: bool,
}

impl Out {
    fn new(version: &str, format: Format) -> Self {
        let mut out = Self {
            bytes: Vec::new(),
            format,
            fresh: true,
        };
        let kind = i32::from(format != Format::Ascii);
        out.text(&format!("$MeshFormat\n{version} {kind} 8\n"));
        if format != Format::Ascii {
            out.int(1);
            out.text("\n");
        }
        out.text("$EndMeshFormat\n");
        out
    }
    fn text(&mut self, text: &str) {
        self.bytes.extend(text.bytes());
        self.fresh = true;
    }
    fn put(&mut self, word: String, little: &[u8]) {
        match self.format {
            Format::Ascii => {
                if !self.fresh {
                    self.bytes.push(b' ');
                }
                self.bytes.extend(word.bytes());
                self.fresh = false;
            }
            Format::Little => self.bytes.extend(little),
            Format::Big => self.bytes.extend(little.iter().rev()),
        }
    }
    fn int(&mut self, x: i32) {
        self.put(x.to_string(), &x.to_le_bytes());
    }
    fn ints(&mut self, xs: &[i32]) {
        xs.iter().for_each(|&x| self.int(x));
    }
    fn size(&mut self, x: u64) {
        self.put(x.to_string(), &x.to_le_bytes());
    }
    fn sizes(&mut self, xs: &[u64]) {
        xs.iter().for_each(|&x| self.size(x));
    }
    fn doubles(&mut self, xs: &[f64]) {
        for &x in xs {
            self.put(format!("{x:?}"), &x.to_le_bytes());
        }
    }
    fn row(&mut self) {
        if self.format == Format::Ascii {
            self.text("\n");
        }
    }
}

/// How nodes and elements are tagged in the file, and what else is in it.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// Tag of node `i` is `offset + stride * i`, counted down where `reverse`.
    pub offset: u64,
    pub stride: u64,
    pub reverse: bool,
    /// Adds points, lines and a node that no triangle uses.
    pub clutter: bool,
    /// Height of the plane.
    pub z: f64,
}

pub const PLAIN: Style = Style {
    offset: 1,
    stride: 1,
    reverse: false,
    clutter: false,
    z: 0.0,
};

impl Style {
    pub fn tag(&self, mesh: &RawMesh, i: usize) -> u64 {
        let i = if self.reverse {
            mesh.points.len() - 1 - i
        } else {
            i
        };
        self.offset + self.stride * i as u64
    }
    fn nodes(&self, mesh: &RawMesh) -> Vec<(u64, [f64; 3])> {
        let mut nodes: Vec<_> = (0..mesh.points.len())
            .map(|i| {
                (
                    self.tag(mesh, i),
                    [mesh.points[i][0], mesh.points[i][1], self.z],
                )
            })
            .collect();
        if self.clutter {
            let tag = 1 + nodes.iter().map(|n| n.0).max().unwrap_or(0);
            nodes.insert(1, (tag, [17.0, 18.0, self.z + 100.0]));
        }
        nodes
    }
    fn corners(&self, mesh: &RawMesh, t: usize) -> Vec<u64> {
        mesh.triangles[t]
            .iter()
            .map(|&v| self.tag(mesh, v as usize))
            .collect()
    }
}

pub fn write22(mesh: &RawMesh, format: Format, style: Style) -> Vec<u8> {
    let mut out = Out::new("2.2", format);
    out.text("$PhysicalNames\n1\n2 7 \"plate\"\n$EndPhysicalNames\n");
    let nodes = style.nodes(mesh);
    out.text(&format!("$Nodes\n{}\n", nodes.len()));
    for (tag, position) in &nodes {
        out.int(*tag as i32);
        out.doubles(position);
        out.row();
    }
    let clutter = if style.clutter { 3 } else { 0 };
    out.text(if format == Format::Ascii { "" } else { "\n" });
    out.text(&format!(
        "$EndNodes\n$Elements\n{}\n",
        mesh.triangles.len() + clutter
    ));
    let first = nodes[0].0 as i32;
    let mut tag = 0;
    // In binary, a block a element keeps the writer simple and the headers frequent.
    let mut element = |out: &mut Out, kind: i32, tags: &[i32], nodes: &[i32]| {
        tag += 1;
        if format == Format::Ascii {
            out.ints(&[tag, kind, tags.len() as i32]);
        } else {
            out.ints(&[kind, 1, tags.len() as i32, tag]);
        }
        out.ints(tags);
        out.ints(nodes);
        out.row();
    };
    if clutter > 0 {
        element(&mut out, 15, &[3, 1], &[first]);
        element(&mut out, 1, &[], &[first, first]);
        element(&mut out, 8, &[1, 1, 1, 1], &[first, first, first]);
    }
    for t in 0..mesh.triangles.len() {
        let nodes: Vec<i32> = style.corners(mesh, t).iter().map(|&v| v as i32).collect();
        match mesh.regions[t] {
            0 => element(&mut out, 2, &[], &nodes),
            r => element(&mut out, 2, &[r, 1], &nodes),
        }
    }
    out.text(if format == Format::Ascii { "" } else { "\n" });
    out.text("$EndElements\n");
    out.bytes
}

pub fn write41(mesh: &RawMesh, format: Format, style: Style) -> Vec<u8> {
    let mut out = Out::new("4.1", format);
    let end = |out: &mut Out, name: &str| {
        out.text(if format == Format::Ascii { "" } else { "\n" });
        out.text(&format!("$End{name}\n"));
    };
    out.text("$PhysicalNames\n1\n2 7 \"plate\"\n$EndPhysicalNames\n");
    // A surface for each run of triangles with the same region; its tag counts from 11.
    let runs: Vec<&[i32]> = mesh.regions.chunk_by(|a, b| a == b).collect();
    out.text("$Entities\n");
    out.sizes(&[1, 1, runs.len() as u64, 0]);
    out.row();
    out.int(1);
    out.doubles(&[0.0, 0.0, 0.0]);
    out.size(0);
    out.row();
    out.int(1);
    out.doubles(&[0.0, 0.0, 0.0, 1.0, 1.0, 0.0]);
    out.size(1);
    out.int(5);
    out.size(2);
    out.ints(&[1, -1]);
    out.row();
    for (k, run) in runs.iter().enumerate() {
        out.int(11 + k as i32);
        out.doubles(&[0.0, 0.0, 0.0, 1.0, 1.0, 0.0]);
        match run[0] {
            0 => out.size(0),
            r => {
                out.size(2);
                out.ints(&[r, 99]);
            }
        }
        out.size(1);
        out.int(1);
        out.row();
    }
    end(&mut out, "Entities");

    let nodes = style.nodes(mesh);
    let tags: Vec<u64> = nodes.iter().map(|n| n.0).collect();
    let (min, max) = (*tags.iter().min().unwrap(), *tags.iter().max().unwrap());
    // Two blocks, so that the tags of the second do not start at one.
    let blocks: Vec<_> = nodes.chunks(nodes.len().div_ceil(2)).collect();
    out.text("$Nodes\n");
    out.sizes(&[blocks.len() as u64, nodes.len() as u64, min, max]);
    out.row();
    for block in blocks {
        out.ints(&[2, 11, 0]);
        out.size(block.len() as u64);
        out.row();
        for (tag, _) in block {
            out.size(*tag);
            out.row();
        }
        for (_, position) in block {
            out.doubles(position);
            out.row();
        }
    }
    end(&mut out, "Nodes");

    let clutter = if style.clutter { 2 } else { 0 };
    let total = (mesh.triangles.len() + clutter) as u64;
    out.text("$Elements\n");
    out.sizes(&[(runs.len() + clutter) as u64, total, 1, total]);
    out.row();
    let mut tag = 0;
    if clutter > 0 {
        for (dim, kind, corners) in [(0, 15, 1), (1, 1, 2)] {
            out.ints(&[dim, 1, kind]);
            out.size(1);
            out.row();
            tag += 1;
            out.size(tag);
            out.sizes(&vec![tags[0]; corners]);
            out.row();
        }
    }
    let mut t = 0;
    for (k, run) in runs.iter().enumerate() {
        out.ints(&[2, 11 + k as i32, 2]);
        out.size(run.len() as u64);
        out.row();
        for _ in *run {
            tag += 1;
            out.size(tag);
            out.sizes(&style.corners(mesh, t));
            out.row();
            t += 1;
        }
    }
    end(&mut out, "Elements");
    out.bytes
}
