//! A copy of a finished run that is changed: single numbers of its files, with or without checksums that fit.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use adapt::output::checksum::checksum;
use serde_json::Value;

/// A copy of a run in a folder of its own.
pub struct Copy {
    folder: tempfile::TempDir,
}

/// Where an array stands in a file.
struct Place {
    /// Its tag with the attributes.
    tag: Range<usize>,
    /// Its base64, or its bytes in the block behind the text, the length included.
    data: Range<usize>,
    /// Whether it stands in that block.
    raw: bool,
}

impl Copy {
    pub fn of(run: &Path) -> Copy {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for entry in fs::read_dir(run).expect("the run") {
            let entry = entry.expect("an entry");
            fs::copy(entry.path(), folder.path().join(entry.file_name())).expect("copied");
        }
        Copy { folder }
    }

    pub fn path(&self) -> PathBuf {
        self.folder.path().to_path_buf()
    }

    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Changes a file as text.
    pub fn text(&self, name: &str, change: impl FnOnce(String) -> String) {
        let text = |bytes| String::from_utf8(bytes).expect("text");
        self.change(name, |bytes| change(text(bytes)).into_bytes());
    }

    /// Changes a file.
    pub fn change(&self, name: &str, change: impl FnOnce(Vec<u8>) -> Vec<u8>) {
        let before = fs::read(self.file(name)).expect("a file");
        let after = change(before.clone());
        assert!(before != after, "nothing was changed in {name}");
        fs::write(self.file(name), after).expect("written");
    }

    /// Puts other text in the place where a text first stands.
    pub fn replace(&self, name: &str, from: &str, to: &str) {
        self.change(name, |bytes| {
            let at = position(&bytes, from.as_bytes()).expect("the text");
            [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()
        });
    }

    /// Cuts a file in the middle.
    pub fn halve(&self, name: &str) {
        self.change(name, |bytes| bytes[..bytes.len() / 2].to_vec());
    }

    /// Changes the bytes of an array of a VTK file, and takes its stated range away.
    fn bytes(&self, name: &str, array: &str, change: impl FnOnce(&mut [u8])) {
        self.change(name, |mut file| {
            let place = find(&file, array);
            if place.raw {
                // The first eight are the length.
                change(&mut file[place.data][8..]);
                return file;
            }
            let mut bytes = decode(&file[place.data.clone()]);
            change(&mut bytes[8..]);
            let tag = std::str::from_utf8(&file[place.tag.clone()]).expect("text");
            let tag: Vec<&str> = tag.split(' ').filter(|a| !a.starts_with("Range")).collect();
            [
                &file[..place.tag.start],
                tag.join(" ").as_bytes(),
                b">",
                encode(&bytes).as_bytes(),
                &file[place.data.end..],
            ]
            .concat()
        });
    }

    /// Changes an array of doubles.
    pub fn reals(&self, name: &str, array: &str, change: impl FnOnce(&mut Vec<f64>)) {
        self.bytes(name, array, |bytes| {
            let (rows, _) = bytes.as_chunks_mut::<8>();
            let mut values: Vec<f64> = rows.iter().map(|r| f64::from_le_bytes(*r)).collect();
            change(&mut values);
            rows.iter_mut()
                .zip(values)
                .for_each(|(r, v)| *r = v.to_le_bytes());
        });
    }

    /// Changes one entry of an array of integers of N bytes.
    pub fn integer<const N: usize>(&self, name: &str, array: &str, at: usize, value: u64) {
        self.bytes(name, array, |bytes| {
            bytes.as_chunks_mut::<N>().0[at].copy_from_slice(&value.to_le_bytes()[..N]);
        });
    }

    /// The doubles of an array.
    pub fn read(&self, name: &str, array: &str) -> Vec<f64> {
        let bytes = self.bytes_of(name, array);
        let (rows, _) = bytes.as_chunks::<8>();
        rows.iter().map(|r| f64::from_le_bytes(*r)).collect()
    }

    /// The bytes of an array.
    pub fn bytes_of(&self, name: &str, array: &str) -> Vec<u8> {
        let file = fs::read(self.file(name)).expect("a file");
        let place = find(&file, array);
        let data = &file[place.data];
        let decoded = if place.raw { data } else { &decode(data) };
        decoded[8..].to_vec()
    }

    pub fn summary(&self, change: impl FnOnce(&mut Value)) {
        self.text("summary.json", |text| {
            let mut summary: Value = serde_json::from_str(&text).expect("JSON");
            change(&mut summary);
            format!("{summary:#}\n")
        })
    }

    /// Changes a column of one level in the history, and in the summary if it is the last.
    pub fn column(&self, level: usize, name: &str, value: &str) {
        let mut last = false;
        self.text("history.csv", |text| {
            let mut rows: Vec<Vec<String>> = text
                .lines()
                .map(|line| line.split(',').map(str::to_owned).collect())
                .collect();
            let column = rows[0].iter().position(|n| n == name).expect("a column");
            last = level + 2 == rows.len();
            rows[level + 1][column] = value.to_owned();
            let lines: Vec<String> = rows.iter().map(|r| r.join(",")).collect();
            lines.join("\n") + "\n"
        });
        if last {
            let value = serde_json::from_str(value).unwrap_or_else(|_| Value::from(value));
            self.summary(|summary| summary[name] = value);
        }
    }

    /// Scales a number of one level in the history, and in the summary if it is the last.
    pub fn scale_column(&self, level: usize, name: &str, factor: f64) {
        let text = fs::read_to_string(self.file("history.csv")).expect("text");
        let rows: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
        let column = rows[0].iter().position(|n| *n == name).expect("a column");
        let value: f64 = rows[level + 1][column].parse().expect("a number");
        self.column(level, name, &format!("{:?}", value * factor));
    }

    /// Makes the checksums those of the files as they are.
    pub fn fit(&self) {
        let text = fs::read_to_string(self.file("summary.json")).expect("text");
        let mut summary: Value = serde_json::from_str(&text).expect("JSON");
        for (name, sum) in summary["checksums"].as_object_mut().expect("checksums") {
            if let Ok(bytes) = fs::read(self.file(name)) {
                *sum = checksum(&bytes).into();
            }
        }
        let rest = summary.as_object_mut().expect("an object");
        rest.shift_remove("checksum");
        let sum = adapt::output::summary::own_sum(rest);
        rest.insert("checksum".into(), sum.into());
        fs::write(self.file("summary.json"), format!("{summary:#}\n")).expect("written");
    }
}

fn position(bytes: &[u8], wanted: &[u8]) -> Option<usize> {
    bytes.windows(wanted.len()).position(|w| w == wanted)
}

fn find(file: &[u8], array: &str) -> Place {
    let name = position(file, format!("Name=\"{array}\"").as_bytes()).expect("the array");
    let start = file[..name].iter().rposition(|&b| b == b'<');
    let start = start.expect("a tag");
    let open = name + position(&file[name..], b">").expect("the end of the tag");
    let tag = std::str::from_utf8(&file[start..open]).expect("text");
    let Some((_, offset)) = tag.split_once(" offset=\"") else {
        let end = open + position(&file[open..], b"<").expect("the end of the array");
        return Place {
            tag: start..open,
            data: open + 1..end,
            raw: false,
        };
    };
    let offset: usize = offset.trim_end_matches("\"/").parse().expect("a number");
    let block = position(file, b"<AppendedData").expect("a block");
    let begin = block + position(&file[block..], b"_").expect("its first byte") + 1 + offset;
    let length: [u8; 8] = file[begin..begin + 8].try_into().expect("a length");
    Place {
        tag: start..open,
        data: begin..begin + 8 + u64::from_le_bytes(length) as usize,
        raw: true,
    }
}

const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

fn decode(text: &[u8]) -> Vec<u8> {
    let (mut bits, mut count, mut bytes) = (0u32, 0, Vec::new());
    for &digit in text.iter().take_while(|&&d| d != b'=') {
        let value = DIGITS.iter().position(|&d| d == digit).expect("base64");
        bits = bits << 6 | value as u32;
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    bytes
}

fn encode(bytes: &[u8]) -> String {
    let mut text = String::new();
    for group in bytes.chunks(3) {
        let mut word = [0; 4];
        word[1..=group.len()].copy_from_slice(group);
        let word = u32::from_be_bytes(word);
        for k in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * k)) as usize & 63];
            text.push(if k > group.len() { '=' } else { digit as char });
        }
    }
    text
}
