//! Imports point down the layers; the lower layers stay bare.

use std::fs;
use std::path::{Path, PathBuf};

/// The layers, lowest first.
const LAYERS: [&str; 8] = ["time", "wire", "observation", "fdl", "dp", "device", "sim", "study"];

fn sources(dir: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(dir).expect("a directory of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Every source file below a layer: its layer and its text.
fn layered() -> Vec<(usize, PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    sources(&root, &mut found);
    let layer = |path: &Path| {
        let first = path.strip_prefix(&root).ok()?.components().next()?.as_os_str().to_str()?;
        LAYERS.iter().position(|layer| first.trim_end_matches(".rs") == *layer)
    };
    let files = found.into_iter().filter_map(|path| Some((layer(&path)?, path)));
    files.map(|(layer, path)| (layer, path.clone(), fs::read_to_string(path).expect("a source"))).collect()
}

/// Layers that a text names after `crate::`.
fn named(text: &str) -> impl Iterator<Item = usize> {
    text.match_indices("crate::").filter_map(|(at, _)| {
        let name = &text[at + "crate::".len()..];
        let end = name.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(name.len());
        LAYERS.iter().position(|layer| *layer == &name[..end])
    })
}

#[test]
fn imports_point_down_only() {
    let files = layered();
    assert!(files.len() > 40, "the sources are found");
    for (layer, path, text) in &files {
        for other in named(text) {
            assert!(other <= *layer, "{}: {} imports {}", path.display(), LAYERS[*layer], LAYERS[other]);
        }
    }
}

#[test]
fn no_machine_knows_the_true_time() {
    for (layer, path, text) in layered() {
        if layer > 0 && LAYERS[layer] != "sim" && LAYERS[layer] != "study" {
            let imports = text.lines().filter(|line| line.contains("crate::time::"));
            let mut words = imports.flat_map(|line| line.split(|c: char| !c.is_alphanumeric() && c != '_'));
            let names_it = words.any(|word| word == "Time" || word == "World");
            assert!(!names_it, "{} names Time", path.display());
        }
    }
}

#[test]
fn the_lower_layers_use_core_and_alloc_alone() {
    for (layer, path, text) in layered() {
        if LAYERS[layer] != "sim" && LAYERS[layer] != "study" {
            assert!(!text.contains("std::"), "{} names std", path.display());
        }
    }
}

#[test]
fn nothing_depends_on_chance_or_the_wall_clock() {
    for (_, path, text) in layered() {
        for word in ["HashMap", "HashSet", "SystemTime", "thread_rng", "DefaultHasher"] {
            assert!(!text.contains(word), "{} names {word}", path.display());
        }
    }
}
