//! The program as a user calls it: what it leaves, what it says, and how it ends.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};

use assert_cmd::cargo::cargo_bin_cmd;
use tempfile::TempDir;

/// Two encoders and a drive that follows one of them, for 150 ms.
pub(crate) const SCENE: &str = r#"# Does it run?
[run]
seed = 3
duration = "150 ms"

[bus]
rate = "12 Mbit/s"
cable = "100 m"

[master]
address = 2
t_dp = "2 ms"
t_i = "125 us"
t_o = "1 ms"
gc_jitter = { kind = "bounded-normal", sigma = "100 ns", bound = "400 ns" }

[[slave]]
addresses = "3..4"
device = "posital-ocd-dpb1b"
crystal = { within = "50 ppm" }

[[slave]]
address = 5
device = "subscriber-drive"

[[link]]
publisher = 3
subscriber = 5
"#;

/// A directory of its own in which the program is called.
pub(crate) struct Room(TempDir);

impl Room {
    /// A room with [`SCENE`] as `scene.toml`.
    pub(crate) fn new() -> Self {
        let room = Self(tempfile::tempdir().expect("a directory"));
        room.write("scene.toml", SCENE);
        room
    }
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
    pub(crate) fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        fs::write(self.path(name), text).expect("a file");
    }
    /// Calls the program with these arguments.
    pub(crate) fn call(&self, arguments: &[&str]) -> Output {
        cargo_bin_cmd!("isodp").args(arguments).current_dir(self.0.path()).output().expect("the program starts")
    }
    /// Calls it and takes for granted that all is well and nothing is said on the side. Returns the page.
    pub(crate) fn runs(&self, arguments: &[&str]) -> String {
        let output = self.call(arguments);
        assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), ""), "{arguments:?}");
        text(&output.stdout).to_owned()
    }
    /// Every file and directory below, with what the files hold.
    fn contents(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut found = BTreeMap::new();
        collect(self.0.path(), &mut found);
        found
    }
    /// Names of the files in a directory.
    fn names(&self, dir: &str) -> BTreeSet<String> {
        let entries = fs::read_dir(self.path(dir)).expect("a directory");
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect()
    }
    /// Calls the program, which says exactly `expected`, ends with 2 and leaves everything as it was.
    #[track_caller]
    pub(crate) fn refuses(&self, arguments: &[&str], expected: &str) {
        let before = self.contents();
        let output = self.call(arguments);
        assert_eq!(text(&output.stderr).trim_end(), expected.trim(), "{arguments:?}");
        assert_eq!((output.status.code(), text(&output.stdout)), (Some(2), ""), "{arguments:?}");
        assert!(before == self.contents(), "{arguments:?} left something");
    }
    /// As [`Self::refuses`], of [`SCENE`] after `from` became `to`.
    #[track_caller]
    fn refuses_scene(&self, from: &str, to: &str, expected: &str) {
        assert_eq!(SCENE.matches(from).count(), 1, "{from}");
        self.write("scene.toml", SCENE.replace(from, to));
        self.refuses(&["run", "scene.toml"], expected);
    }
}

fn collect(dir: &Path, found: &mut BTreeMap<PathBuf, Vec<u8>>) {
    for entry in fs::read_dir(dir).expect("a directory") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            collect(&path, found);
            found.insert(path, Vec::new());
        } else {
            // What may not be read is known by its name alone.
            let octets = fs::read(&path).unwrap_or_default();
            found.insert(path, if octets.len() > 10_000_000 { Vec::new() } else { octets });
        }
    }
}

fn text(octets: &[u8]) -> &str {
    std::str::from_utf8(octets).expect("text")
}

#[test]
fn help_shows_examples_that_can_be_taken_over() {
    let room = Room::new();
    for arguments in [&["--help"][..], &["run", "--help"], &["help", "run"]] {
        let page = room.runs(arguments);
        assert!(page.contains("isodp run scenarios/reference.toml --seed 7 --out /tmp/results\n"), "{page}");
        assert!(page.contains("--set master.t_o='1.5 ms'"), "{page}");
        assert!(page.contains("Exit codes: 0"), "{page}");
        assert!(page.lines().all(|line| line.chars().count() <= 120), "{page}");
    }
    assert!(room.runs(&["--version"]).starts_with("isodp "));
}

#[test]
fn a_run_without_headway_leaves_nothing_that_was_not_there() {
    let room = Room::new();
    let call = ["run", "scene.toml", "--set", "run.duration=6 s", "--set", "run.max_events=3", "--out"];
    for (out, there) in [("made", None), ("some/where/deep", None), ("old", Some("old")), ("full", Some("full/scene"))]
    {
        if let Some(there) = there {
            fs::create_dir_all(room.path(there)).expect("a directory");
        }
        let before = room.contents();
        let output = room.call(&[&call[..], &[out]].concat());
        let said = text(&output.stderr);
        assert_eq!((output.status.code(), text(&output.stdout)), (Some(2), ""), "{said}");
        assert!(said.contains("the run makes no headway"), "{said}");
        assert!(before == room.contents(), "{out}: {:?}", room.contents().keys());
    }
}

#[test]
fn results_are_in_the_directory_of_the_scenario_and_nowhere_else() {
    let room = Room::new();
    let page = room.runs(&["run", "scene.toml"]);
    assert_eq!(room.names("."), BTreeSet::from(["scene.toml".to_owned(), "out".to_owned()]));
    assert_eq!(room.names("out"), BTreeSet::from(["scene".to_owned()]));
    let summary: serde_json::Value =
        serde_json::from_slice(&fs::read(room.path("out/scene/summary.json")).expect("a summary")).expect("JSON");
    let named: BTreeSet<_> = summary["files"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|name| name.as_str().expect("a name").to_owned())
        .collect();
    assert_eq!(room.names("out/scene"), named);
    assert!(page.ends_with(&format!("{} files in out/scene\n", named.len())), "{page}");
}

#[test]
fn seed_out_and_set_do_what_they_say() {
    let room = Room::new();
    let page = room.runs(&[
        "run",
        "scene.toml",
        "--seed",
        "9",
        "--out",
        "deep/results",
        "--set",
        "run.duration=100 ms",
        "--set",
        "slave.3.t_o=875 us",
    ]);
    assert!(page.contains(" in 100 ms, seed 9\n"), "{page}");
    assert!(page.contains("T_O 875 us to 1 ms"), "{page}");
    assert!(page.ends_with(" files in deep/results/scene\n"), "{page}");
    assert_eq!(room.names("."), BTreeSet::from(["scene.toml".to_owned(), "deep".to_owned()]));
    let other = room.runs(&["run", "scene.toml", "--set", "record.files=false"]);
    assert!(!room.path("out").exists(), "no files are wanted");
    let fingerprint = |page: &str| page.lines().find(|line| line.starts_with("fingerprint")).map(str::to_owned);
    assert_ne!(fingerprint(&page), fingerprint(&other));
}

#[test]
fn cycles_are_as_many_as_the_scenario_says() {
    let room = Room::new();
    let page = room.runs(&["run", "scene.toml", "--set", "run.cycles=50"]);
    assert!(page.contains(", 50 cycles in "), "{page}");
    let rows = fs::read_to_string(room.path("out/scene/cycles.csv")).expect("a table");
    assert_eq!(rows.lines().count(), 1 + 50);
}

#[test]
fn two_runs_give_the_same_octets_and_a_second_one_takes_the_place_of_the_first() {
    let room = Room::new();
    room.runs(&["run", "scene.toml"]);
    let first = room.contents();
    room.runs(&["run", "scene.toml"]);
    assert!(first == room.contents(), "the second run left other files");
    room.runs(&["run", "scene.toml", "--seed", "4"]);
    let third = room.contents();
    assert!(first.keys().eq(third.keys()));
    for (path, octets) in &third {
        let name = path.file_name().expect("a name").to_string_lossy();
        let follows_the_seed = path.is_file() && name.ends_with(".svg");
        assert!(!follows_the_seed || octets != &first[path], "{name} is the old one");
    }
}

#[test]
fn keys_and_values_that_are_wrong() {
    let room = Room::new();
    room.refuses_scene(
        "t_o = ",
        "t_0 = ",
        r#"
error: scene.toml:10:2: master.t_o: this key is missing, and slave 3 has no own t_o
  10 | [master]
     |  ^^^^^^
  rule: every slave has its T_O (manual 3.3)
  help: for example: t_o = "1 ms"

scene.toml:14:1: master.t_0: there is no such key
  14 | t_0 = "1 ms"
     | ^^^
  help: did you mean "t_o"?
"#,
    );
    room.refuses_scene(
        "\"1 ms\"",
        "\"1 mm\"",
        r#"
error: scene.toml:14:7: master.t_o: "1 mm" has the unit "mm"; a time has one of the units ns, us, ms, s, min, h, tick, tbit
  14 | t_o = "1 mm"
     |       ^^^^^^
"#,
    );
    room.refuses_scene(
        "\"2 ms\"",
        "\"2.05 ms\"",
        r#"
error: scene.toml:12:8: master.t_dp: T_DP = 2.05 ms is not on the grid of posital-ocd-dpb1b
  12 | t_dp = "2.05 ms"
     |        ^^^^^^^^^
  rule: T_DP is a multiple of T_BASE_DP = 125 us (manual 3.3.1, 3.3.2)
  help: the neighbours are t_dp = "2 ms" and "2.125 ms"
"#,
    );
    room.refuses_scene(
        "\"150 ms\"",
        "\"99999999999999999999 s\"",
        r#"
error: scene.toml:4:12: run.duration: "99999999999999999999 s" is beyond the range of a time, -24 years to 24 years
  4 | duration = "99999999999999999999 s"
    |            ^^^^^^^^^^^^^^^^^^^^^^^^
"#,
    );
    room.refuses_scene(
        "\"150 ms\"",
        "\"1e9 s\"",
        r#"
error: scene.toml:4:12: run.duration: "1e9 s" has an exponent, which is not read; a time has one of the units ns, us, ms, s, min, h, tick
  4 | duration = "1e9 s"
    |            ^^^^^^^
"#,
    );
}

#[test]
fn networks_that_cannot_be() {
    let room = Room::new();
    room.refuses_scene(
        "address = 5\n",
        "address = 4\n",
        r"
error: scene.toml:23:11: slave.address: two slaves have the address 4
  23 | address = 4
     |           ^
  rule: every station of a bus has an address of its own (EN 50170-2)
",
    );
    room.refuses_scene(
        "publisher = 3",
        "publisher = 5",
        r"
error: scene.toml:27:13: link.1.publisher: slave 5 cannot publish
  27 | publisher = 5
     |             ^
  rule: subscriber-drive has no publisher function (its profile, manual 3.4)
",
    );
    room.refuses_scene(
        "\"1 ms\"",
        "\"250 us\"",
        r#"
error: scene.toml:14:7: slave.3.t_o: T_O = 250 us is too early for slave 3
  14 | t_o = "250 us"
     |       ^^^^^^^^
  rule: T_O > T_DX + T_O_MIN = 374.833 us + 125 us = 499.833 us (manual 3.3.6, Model: D3)
  help: the earliest is t_o = "500 us"
"#,
    );
    room.refuses_scene(
        "\"3..4\"",
        "\"3, 6..34\"",
        r#"
error: scene.toml:12:8: master.t_dp: T_DP = 2 ms cannot hold the cycle of 31 slaves
  12 | t_dp = "2 ms"
     |        ^^^^^^
  rule: T_DP >= T_DX 3.306 ms + GAP 95.167 us + token 9.083 us + Global_Control 18.25 us = 3.428 ms (manual 3.3.2)
  help: the shortest is t_dp = "3.75 ms"
"#,
    );
    room.refuses_scene(
        "\"3..4\"",
        "\"3, 6..35\"",
        r#"
error: scene.toml:18:13: slave.35.address: 33 stations and repeaters are too many
  18 | addresses = "3, 6..35"
     |             ^^^^^^^^^^
  rule: a segment has at most 32 loads, each station and each repeater or link module on it counts as one (EN 50170-2, RS 485)
  help: divide it: [[segment]] with name and cable, [[repeater]] with from and to, and segment for each station
"#,
    );
}

#[test]
fn every_problem_is_told_at_once() {
    let room = Room::new();
    room.write("scene.toml", SCENE.replace("seed = 3", "sed = 3").replace("\"100 m\"", "\"100 l\""));
    room.refuses(
        &["run", "scene.toml", "--set", "slave.9.crystal=1 ppm"],
        r#"
error: scene.toml:3:1: run.sed: there is no such key
  3 | sed = 3
    | ^^^
  help: did you mean "seed"?

scene.toml:8:9: bus.cable: "100 l" has the unit "l"; a length has one of the units mm, cm, m, km
  8 | cable = "100 l"
    |         ^^^^^^^

--set "slave.9.crystal=1 ppm": slave.9.crystal: no slave has the address "9"
  help: the slaves are 3, 4, 5
"#,
    );
}

#[test]
fn files_that_are_no_scenarios() {
    let room = Room::new();
    let run = |name: &str, expected: &str| room.refuses(&["run", name], &format!("error: {name}: {expected}"));
    run("none.toml", "there is no such file");
    fs::create_dir(room.path("folder")).expect("a directory");
    run("folder", "this is a directory\n  help: name one scenario file in it, *.toml");
    run("scene.toml/more", "this file cannot be read: Not a directory (os error 20)");
    room.write("empty.toml", "");
    run("empty.toml", "the scenario is empty\n  help: it needs [run], [bus], [master] and a [[slave]]");
    let sparse = fs::File::create(room.path("huge.toml")).expect("a file");
    sparse.set_len(100_000_000).expect("a sparse file");
    run("huge.toml", "a 100 MB file is no scenario\n  rule: a scenario has at most 4 MB");
    room.write("junk.toml", [b'a', b'\n', 0xFF, 0xFE, 0, 1]);
    run(
        "junk.toml",
        "this file is no UTF-8 text: octet FF in line 2\n  help: save it as UTF-8; a scenario is a text file",
    );
    room.write("zeros.toml", [0; 4_096]);
    room.refuses(
        &["run", "zeros.toml"],
        "error: zeros.toml:1:4097: key with no value, expected `=`\n  rule: the file is TOML 1.0 (toml.io)",
    );
    room.write("...toml", SCENE);
    run(
        "...toml",
        "this file has no name before its extension\n  rule: the results of NAME.toml go to a directory NAME\n  \
         help: rename it",
    );
}

#[test]
fn overrides_that_are_wrong() {
    let room = Room::new();
    let set = |set: &str, expected: &str| room.refuses(&["run", "scene.toml", "--set", set], expected);
    set(
        "run.sed=3",
        r#"
error: --set "run.sed=3": run.sed: there is no such key
  help: did you mean "seed"?
"#,
    );
    set(
        "slave.9.t_o=1 ms",
        r#"
error: --set "slave.9.t_o=1 ms": slave.9.t_o: no slave has the address "9"
  help: the slaves are 3, 4, 5
"#,
    );
    for bad in ["master.t_o", "=3", ""] {
        set(
            bad,
            &format!(
                "error: invalid value '{bad}' for '--set <KEY=VALUE>': {bad:?} is no KEY=VALUE, such as master.t_o='1.5 ms'\n\n\
                 For more information, try '--help'."
            ),
        );
    }
    for bad in ["", "soon"] {
        set(
            &format!("master.t_o={bad}"),
            &format!(
                "error: --set \"master.t_o={bad}\": master.t_o: \"{bad}\" is not a time: write a number and a unit, such as \
                 \"125 us\""
            ),
        );
    }
}

#[test]
fn calls_that_are_wrong() {
    let room = Room::new();
    for bad in ["x", "-1", "1.5", "18446744073709551616"] {
        room.refuses(
            &["run", "scene.toml", "--seed", bad],
            &format!(
                "error: invalid value '{bad}' for '--seed <N>': a seed is a whole number from 0 to 18446744073709551615\n\n\
                 For more information, try '--help'."
            ),
        );
    }
    room.refuses(
        &["run"],
        "error: the following required arguments were not provided:\n  <FILE>...\n\nUsage: isodp run <FILE>...\n\nFor more \
         information, try '--help'.",
    );
    room.refuses(
        &["simulate"],
        "error: unrecognized subcommand 'simulate'\n\nUsage: isodp <COMMAND>\n\nFor more information, try '--help'.",
    );
    assert_eq!(room.call(&[]).status.code(), Some(2));
}

#[test]
fn places_where_no_results_can_be() {
    let room = Room::new();
    let out = |out: &str, expected: &str| room.refuses(&["run", "scene.toml", "--out", out], expected);
    out("scene.toml", "error: cannot make the directory scene.toml/scene: Not a directory (os error 20)");
    fs::create_dir(room.path("taken")).expect("a directory");
    room.write("taken/scene", "");
    out("taken", "error: cannot make the directory taken/scene: File exists (os error 17)");
    #[cfg(target_os = "linux")]
    out("/proc/here", "error: cannot make the directory /proc/here/scene: No such file or directory (os error 2)");
    // The last file of a run cannot have its name: none of the others stays.
    fs::create_dir_all(room.path("held/scene/summary.json/x")).expect("a directory");
    out("held", "error: cannot put held/scene/summary.json in its place: Is a directory (os error 21)");
    fs::create_dir_all(room.path("drawn/scene/position.svg/x")).expect("a directory");
    out("drawn", "error: cannot put drawn/scene/position.svg in its place: Is a directory (os error 21)");
}

/// Files whose mode forbids what the program needs. The system's administrator may do everything, so that the program
/// is called as somebody else then, from a place that everybody can reach.
#[test]
#[cfg(target_os = "linux")]
fn what_the_mode_of_a_file_forbids() {
    use std::os::unix::fs::PermissionsExt;
    use std::os::unix::process::CommandExt;
    const NOBODY: u32 = 65_534;
    let room = Room::new();
    let mode = |name: &str, mode| {
        fs::set_permissions(room.path(name), fs::Permissions::from_mode(mode)).expect("a mode");
    };
    room.write("secret.toml", SCENE);
    fs::create_dir(room.path("locked")).expect("a directory");
    let program = room.path("isodp");
    fs::copy(assert_cmd::cargo::cargo_bin!("isodp"), &program).expect("a copy");
    let administrator = {
        mode("secret.toml", 0);
        fs::File::open(room.path("secret.toml")).is_ok()
    };
    for (name, bits) in [(".", 0o755), ("isodp", 0o755), ("scene.toml", 0o644), ("locked", 0o555)] {
        mode(name, bits);
    }
    let before = room.contents();
    for (arguments, expected) in [
        (&["run", "secret.toml", "--out", "locked"][..], "error: secret.toml: this file may not be read\n"),
        (
            &["run", "scene.toml", "--out", "locked"],
            "error: cannot make the directory locked/scene: Permission denied (os error 13)\n",
        ),
    ] {
        let mut command = std::process::Command::new(&program);
        command.args(arguments).current_dir(room.path("."));
        if administrator {
            command.uid(NOBODY).gid(NOBODY);
        }
        let output = command.output().expect("the program starts");
        assert_eq!((text(&output.stderr), output.status.code()), (expected, Some(2)));
        assert!(before == room.contents(), "something was left");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_page_that_cannot_be_shown_is_told() {
    let room = Room::new();
    let call = |out: Stdio| {
        let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("isodp"));
        command.args(["run", "scene.toml"]).current_dir(room.path(".")).stdout(out).stderr(Stdio::piped());
        command.output().expect("the program starts")
    };
    let full = fs::File::options().write(true).open("/dev/full").expect("a full device");
    let output = call(full.into());
    let expected =
        "error: the files are written, but the page cannot be shown: No space left on device (os error 28)\n";
    assert_eq!((text(&output.stderr), output.status.code()), (expected, Some(2)));
    // A reader that went away has seen enough.
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let output = call(writer.into());
    assert_eq!((text(&output.stderr), output.status.code()), ("", Some(0)));
}

/// What a run does not write, an earlier one may have: its files would tell of another run.
#[test]
fn all_files_are_of_the_latest_run() {
    let room = Room::new();
    let listed = |room: &Room| -> BTreeSet<String> {
        let summary = fs::read(room.path("out/scene/summary.json")).expect("a summary");
        let summary: serde_json::Value = serde_json::from_slice(&summary).expect("JSON");
        let files = summary["files"].as_array().expect("names").iter();
        files.map(|name| name.as_str().expect("a name").to_owned()).collect()
    };
    let cut = "\n[[disturbance]]\nkind = \"missing-clocks\"\ncycle = 60\nfor = 3\n[record.flight]\non = true\n";
    room.write("scene.toml", SCENE.to_owned() + cut);
    room.runs(&["run", "scene.toml"]);
    let all = room.names("out/scene");
    assert_eq!(all, listed(&room));
    for name in ["flight.txt", "flight.pcapng", "flight.vcd", "profibus_dp.lua", "disturbances.svg", "publish.hlog"] {
        assert!(all.contains(name), "{name}: {all:?}");
    }
    // The user's own file, what another command has made, and a directory that has a name of ours.
    room.write("out/scene/notes.txt", "mine");
    room.write("out/scene/budget.svg", "of isodp budget");
    room.runs(&["run", "scene.toml", "--set", "record.flight.on=false", "--set", "record.plots=false"]);
    let foreign = ["notes.txt", "budget.svg"].map(str::to_owned);
    let expected = |room: &Room| listed(room).into_iter().chain(foreign.clone()).collect::<BTreeSet<_>>();
    assert_eq!(room.names("out/scene"), expected(&room));
    assert!(!listed(&room).iter().any(|name| name.starts_with("flight") || name.contains(".svg")));
    // Neither a link nor a disturbance any more, and no tables.
    fs::create_dir(room.path("out/scene/flight.txt")).expect("a directory");
    room.write("scene.toml", SCENE.split("[[link]]").next().expect("a scene"));
    room.runs(&["run", "scene.toml", "--set", "record.cycles_csv=false", "--set", "record.links_csv=false"]);
    let mut expected = expected(&room);
    assert!(
        !expected.contains("cycles.csv")
            && !expected.contains("publish.hlog")
            && !expected.contains("disturbances.svg")
    );
    expected.insert("flight.txt".to_owned());
    assert_eq!(room.names("out/scene"), expected);
    // A run that writes nothing leaves everything.
    room.runs(&["run", "scene.toml", "--set", "record.files=false"]);
    assert_eq!(room.names("out/scene"), expected);
}

/// Kills a long run after its temporary files are there: none of them has a name of a result.
#[test]
#[cfg(unix)]
fn a_killed_run_leaves_no_file_that_looks_whole() {
    let room = Room::new();
    room.runs(&["run", "scene.toml"]);
    let whole = room.contents();
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin!("isodp"))
        .args(["run", "scene.toml", "--set", "run.duration=24 h"])
        .current_dir(room.path("."))
        .stdout(Stdio::null())
        .spawn()
        .expect("the program starts");
    let begun = || room.names("out/scene").iter().any(|name| name.starts_with('.'));
    for _ in 0..500 {
        if begun() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert!(begun(), "the run writes nothing");
    std::thread::sleep(std::time::Duration::from_millis(100));
    assert_eq!(child.try_wait().expect("a child"), None, "the run is over too early");
    child.kill().expect("SIGKILL");
    child.wait().expect("an end");
    let after = room.contents();
    assert!(whole.iter().all(|(path, octets)| after.get(path) == Some(octets)), "the results of before are gone");
    for path in after.keys().filter(|path| !whole.contains_key(*path)) {
        let name = path.file_name().expect("a name").to_string_lossy();
        assert!(name.starts_with(".isodp-") && name.ends_with(".tmp"), "{name}");
    }
    room.runs(&["run", "scene.toml"]);
}
