//! A copy of a finished run that is changed: single numbers of its files, with or without checksums that fit.

use std::fs;
use std::path::{Path, PathBuf};

use adapt::output::checksum::checksum;
use serde_json::Value;

/// A copy of a run in a folder of its own.
pub struct Copy {
    folder: tempfile::TempDir,
}

/// Where an array stands in the text of a file.
struct Place {
    /// The attributes of its tag.
    tag: std::ops::Range<usize>,
    /// Its base64.
    data: std::ops::Range<usize>,
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
        let before = fs::read_to_string(self.file(name)).expect("text");
        let after = change(before.clone());
        assert_ne!(before, after, "nothing was changed in {name}");
        fs::write(self.file(name), after).expect("written");
    }

    pub fn replace(&self, name: &str, from: &str, to: &str) {
        self.text(name, |text| text.replacen(from, to, 1));
    }

    /// Changes the bytes of an array of a VTK file, and takes its stated range away.
    fn bytes(&self, name: &str, array: &str, change: impl FnOnce(&mut [u8])) {
        self.text(name, |text| {
            let place = find(&text, array);
            let mut bytes = decode(&text[place.data.clone()]);
            // The first eight are the length.
            change(&mut bytes[8..]);
            let tag: Vec<&str> = text[place.tag.clone()]
                .split(' ')
                .filter(|a| !a.starts_with("Range"))
                .collect();
            format!(
                "{}{}>{}{}",
                &text[..place.tag.start],
                tag.join(" "),
                encode(&bytes),
                &text[place.data.end..]
            )
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
        let text = fs::read_to_string(self.file(name)).expect("text");
        let bytes = decode(&text[find(&text, array).data]);
        let (rows, _) = bytes[8..].as_chunks::<8>();
        rows.iter().map(|r| f64::from_le_bytes(*r)).collect()
    }

    /// The bytes of an array.
    pub fn bytes_of(&self, name: &str, array: &str) -> Vec<u8> {
        let text = fs::read_to_string(self.file(name)).expect("text");
        decode(&text[find(&text, array).data])[8..].to_vec()
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

fn find(text: &str, array: &str) -> Place {
    let name = text.find(&format!("Name=\"{array}\"")).expect("the array");
    let tag = text[..name].rfind('<').expect("a tag");
    let open = name + text[name..].find('>').expect("the end of the tag");
    let end = open + text[open..].find('<').expect("the end of the array");
    Place {
        tag: tag..open,
        data: open + 1..end,
    }
}

const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

fn decode(text: &str) -> Vec<u8> {
    let (mut bits, mut count, mut bytes) = (0u32, 0, Vec::new());
    for digit in text.bytes().take_while(|&d| d != b'=') {
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
