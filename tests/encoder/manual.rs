//! The table of the manual's sections in `src/device/mod.rs` is complete and names tests that exist.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Every numbered section of the manual from 2 to 5.3.
const SECTIONS: &[&str] = &[
    "2", "2.1", "2.1.1", "2.1.2", "2.1.3", "2.1.4", "2.1.5", "2.2", "3", "3.1", "3.2", "3.2.1", "3.2.2", "3.2.3",
    "3.2.4", "3.2.5", "3.3", "3.3.1", "3.3.2", "3.3.3", "3.3.4", "3.3.5", "3.3.6", "3.3.7", "3.3.8", "3.3.9", "3.4",
    "4", "5", "5.1", "5.2", "5.3",
];

/// The names of all tests below a directory.
fn tests_below(directory: &Path, names: &mut BTreeSet<String>) {
    for entry in fs::read_dir(directory).expect("a directory") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            tests_below(&path, names);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).expect("a source");
            for after in text.split("#[test]").skip(1) {
                let name = after.split_once("fn ").and_then(|(_, rest)| rest.split_once('('));
                names.extend(name.map(|(name, _)| name.trim().to_owned()));
            }
        }
    }
}
/// The rows of the table: section, types, tests.
fn rows(text: &str) -> Vec<(String, String, Vec<String>)> {
    let cells = text.lines().filter_map(|line| line.strip_prefix("//! | ")?.strip_suffix(" |"));
    let rows = cells.map(|line| line.split(" | ").map(str::trim).collect::<Vec<_>>());
    rows.filter_map(|row| {
        let [section, types, tests] = row[..] else { return None };
        let number = section.split(' ').next().filter(|number| number.starts_with(|c: char| c.is_ascii_digit()))?;
        let tests = tests.split(',').map(|name| name.trim().trim_matches('`').to_owned());
        Some((number.to_owned(), types.to_owned(), tests.collect()))
    })
    .collect()
}

#[test]
fn every_section_of_the_manual_has_its_types_and_its_tests() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut names = BTreeSet::new();
    tests_below(&root.join("tests"), &mut names);
    tests_below(&root.join("src"), &mut names);
    assert!(names.len() > 200, "the tests are found");
    let rows = rows(&fs::read_to_string(root.join("src/device/mod.rs")).expect("a source"));
    let sections: Vec<_> = rows.iter().map(|(section, ..)| section.as_str()).collect();
    assert_eq!(sections, SECTIONS, "each section has one line, in the manual's order");
    for (section, types, tests) in &rows {
        assert!(types.contains("[`"), "{section} names a type");
        for test in tests {
            assert!(names.contains(test), "{section}: there is no test {test}");
        }
    }
}
