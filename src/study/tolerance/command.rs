//! The command `isodp tolerance`.

use std::io::Write as _;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use super::outcome::{Demand, Outcome, Tried};
use super::scale::Scale;
use super::trial::{Progress, Stopped, Trial};
use super::{json, page, picture, table};
use crate::study::export::{ExportError, Staged};
use crate::study::quantity::{Measure, share};
use crate::study::scenario::error::Problem;
use crate::study::scenario::{Fault, Scenario, ScenarioError, written};
use crate::study::statistics::bisection::{Answer as Found, Search};
use crate::study::statistics::confidence::Confidence;
use crate::study::statistics::sequential::SequentialError;
use crate::study::sweep::axis::{key_of, measured};
use crate::study::sweep::definition::Expect;
use crate::study::sweep::plan::Base;
use crate::study::sweep::store::StoreError;

/// Resolution where nothing is said: a hundredth of the value.
const RESOLUTION: f64 = 0.01;

/// What the command was called with, as it was written.
#[derive(Clone, Debug, Default)]
pub struct Call {
    /// The scenario.
    pub file: PathBuf,
    /// Changed values, the seed among them.
    pub sets: Vec<(String, String)>,
    /// Where the results go: to `out/<scenario>/`.
    pub out: PathBuf,
    /// The key that is varied.
    pub vary: String,
    /// Where the search begins: expected to hold. Without it the scenario's own value of the key.
    pub from: Option<String>,
    /// Where it ends: expected to fail.
    pub to: String,
    /// Distance of values.
    pub step: Option<String>,
    /// Distance of values as a share of the value.
    pub resolution: Option<String>,
    /// The second value to try, after the beginning; without it the end.
    pub first: Option<String>,
    /// `figure=condition`; without any, the scenario's own expectations count.
    pub expects: Vec<String>,
    /// How often a verdict on a value may not be wrong; without it 95 %.
    pub confidence: Option<String>,
    /// A share of failing runs that is good enough; without it 1 %.
    pub good_enough: Option<String>,
    /// A share of failing runs that is too much; without it 10 %.
    pub too_much: Option<String>,
    /// Most runs of a value, also where nothing is drawn; without it [`Call::LIMIT`], and one where nothing is drawn.
    pub limit: Option<u64>,
    /// Values that are tried on either side of the answer beside those of the search.
    pub probes: u32,
    /// Threads that run.
    pub threads: usize,
}

impl Call {
    /// Most runs of a value where nothing is said.
    pub const LIMIT: u64 = 200;
}

/// How a call ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum End {
    /// At least where the search begins, what is expected holds.
    Found,
    /// Not even there.
    Nowhere,
    /// It was stopped; nothing was written.
    Stopped,
}

/// What the command says.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Answer {
    /// The page.
    pub page: String,
    /// How it ended.
    pub end: End,
}

/// Why there was no search.
#[derive(Debug, thiserror::Error)]
pub enum ToleranceError {
    /// The call or the scenario is wrong.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// There is no test with these shares.
    #[error("{0}\n  help: --good-enough is below --too-much, and --confidence above 50 %")]
    Test(#[from] SequentialError),
    /// The results cannot be written.
    #[error(transparent)]
    Store(#[from] StoreError),
}
impl From<ExportError> for ToleranceError {
    fn from(error: ExportError) -> Self {
        Self::Store(error.into())
    }
}

/// Carries out `call`. `watch` is told after every run; when `stop` is set, runs are broken off and nothing is written.
///
/// # Errors
/// The call or the scenario is wrong, also at the beginning of the search, or the results cannot be written.
///
/// # Panics
/// Never: a scale has two ends.
pub fn tolerance(call: &Call, stop: &AtomicBool, mut watch: impl FnMut(Progress)) -> Result<Answer, ToleranceError> {
    let (key, demand) = (key(call)?, demand(call)?);
    let base = base(call)?;
    let scale = scale(call, from(call, &base, &key)?)?;
    let mut sets = call.sets.clone();
    for text in &call.expects {
        sets.push(expectation(text)?);
    }
    let scale = taken(&base, &sets, &key, scale);
    let first = call.first.as_ref().map_or(Ok(scale.last()), |text| {
        let number = measured(text).and_then(|value| scale.nearest(value));
        number.map_err(|fault| wrong("--first", text, fault))
    })?;
    let trial = Trial::new((&base, &sets), (&key, &scale), &demand, (call.threads, stop))?;
    let scenario = trial.scenario(0).map_err(|error| blame(error, call, &key, &scale.text(0)))?;
    if scenario.expectations.is_empty() {
        return Err(nothing_expected(&base).into());
    }
    let mut tried: Vec<Tried> = Vec::new();
    let search = Search::new(&scale, 0, first, scale.last(), call.probes).expect("a scale has two ends");
    let found = search.run(|number| {
        let one = trial.of(number, tried.len(), &mut watch)?;
        let tested = one.tested;
        tried.push(one);
        Ok::<_, Stopped>(tested)
    });
    let Ok(found) = found else {
        let runs = tried.iter().map(|tried| tried.tested.runs).sum();
        return Ok(Answer { page: page::stopped(tried.len(), runs), end: End::Stopped });
    };
    tried.sort_by_key(|tried| tried.number);
    let expected = scenario.expectations.iter().map(|one| format!("{} {}", one.figure.name(), one.demand)).collect();
    let outcome = Outcome {
        scenario: base.name.clone(),
        source: base.source.clone(),
        key,
        scale: scale.clone(),
        is_own: call.from.is_none(),
        sets: call.sets.clone(),
        seed: scenario.run.seed,
        expected,
        demand,
        answer: found.answer,
        curve: tried,
        inversions: found.inversions,
    };
    let dir = call.out.join(&outcome.scenario);
    let files = write(&outcome, &dir)?;
    let end = if outcome.answer == Found::Nowhere { End::Nowhere } else { End::Found };
    Ok(Answer { page: format!("{}\n{} in {}\n", page::of(&outcome), files.join(", "), dir.display()), end })
}

/// Writes the tables and the picture. Returns their names.
fn write(outcome: &Outcome, dir: &std::path::Path) -> Result<Vec<String>, ToleranceError> {
    std::fs::create_dir_all(dir).map_err(|source| ExportError::Directory { path: dir.to_owned(), source })?;
    let names = ["csv", "json", "svg"].map(|extension| outcome.file(extension));
    let drawn = picture::draw(outcome).map_err(|reason| StoreError::Plot { file: names[2].clone(), reason })?;
    let mut staged = vec![table::write(dir, &names[0], outcome)?];
    for (name, text) in [(&names[1], json::text(outcome)), (&names[2], drawn)] {
        let mut file = Staged::create(dir, name)?;
        file.write_all(text.as_bytes()).map_err(|error| file.error(error))?;
        staged.push(file);
    }
    Staged::place_all(staged)?;
    Ok(names.into())
}

/// `scale`; a finer one where the scenario takes fractions between whole ends, or a coarser one where it takes the value next
/// to the beginning on that alone.
fn taken(base: &Base, sets: &[(String, String)], key: &str, scale: Scale) -> Scale {
    let takes = |scale: &Scale, number| {
        let mut sets = sets.to_vec();
        sets.push((key.to_owned(), scale.text(number)));
        base.with(&sets).is_ok()
    };
    if !takes(&scale, 0) {
        return scale;
    }
    if let Some(finer) = scale.finer().filter(|finer| takes(finer, 1)) {
        return finer;
    }
    if takes(&scale, 1) {
        return scale;
    }
    let coarser = scale.coarser().find(|coarser| takes(coarser, 1));
    coarser.unwrap_or(scale)
}

/// `fault` of an option.
fn wrong(option: &str, text: &str, fault: Fault) -> ScenarioError {
    ScenarioError::about_file(&format!("{option} \"{text}\""), fault)
}

fn key(call: &Call) -> Result<String, ScenarioError> {
    let error = |fault| wrong("--vary", &call.vary, fault);
    if call.vary.trim() == "run.seed" {
        let fault = Fault::new("seeds are no parameter").rule("every run of a value has a seed of its own");
        return Err(error(fault.help("--limit N is the largest number of runs of a value")));
    }
    let key = key_of(&call.vary).map_err(error)?;
    if call.sets.iter().any(|(other, _)| *other == key) {
        return Err(error(Fault::new("this key is set and varied").help("leave out its --set")));
    }
    Ok(key)
}

fn read(option: &str, text: &str) -> Result<Measure, ScenarioError> {
    measured(text).map_err(|fault| wrong(option, text, fault))
}

/// Where the search begins.
fn from(call: &Call, base: &Base, key: &str) -> Result<Measure, ScenarioError> {
    if let Some(from) = &call.from {
        return read("--from", from);
    }
    let own = written(&base.source, &base.text, &call.sets, key)?;
    let about = |fault: Fault| wrong("--vary", key, fault.help("write --from VALUE, a value that is expected to hold"));
    let own = own.ok_or_else(|| {
        about(Fault::new(format!("{} does not set this key, so that the search has no beginning", base.source)))
    })?;
    measured(&own).map_err(|fault| about(Fault::new(format!("{} has {own} here: {}", base.source, fault.message))))
}

fn scale(call: &Call, from: Measure) -> Result<Scale, ScenarioError> {
    let to = read("--to", &call.to)?;
    if let Some(step) = &call.step {
        let scale = Scale::stepped(from, to, read("--step", step)?);
        return scale.map_err(|fault| wrong("--step", step, fault));
    }
    let resolution = call.resolution.as_ref().map_or(Ok(RESOLUTION), |text| portion("--resolution", text))?;
    if resolution <= 0.0 || resolution >= 1.0 {
        let text = call.resolution.clone().unwrap_or_default();
        let fault = Fault::new("a resolution is a share of the value, above 0 and below 100 %");
        return Err(wrong("--resolution", &text, fault.help("1 % is usual; --step takes a distance")));
    }
    Scale::resolved(from, to, resolution).map_err(|fault| wrong("--to", &call.to, fault))
}

/// A share of a whole.
fn portion(option: &str, text: &str) -> Result<f64, ScenarioError> {
    let share = share(text).map_err(|error| wrong(option, text, Fault::new(error.to_string())))?;
    Ok(share.parts() as f64 / crate::sim::share::Share::WHOLE as f64)
}

fn demand(call: &Call) -> Result<Demand, ScenarioError> {
    let portion = |option, text: &Option<String>, usual| text.as_ref().map_or(Ok(usual), |text| portion(option, text));
    let confidence = portion("--confidence", &call.confidence, Confidence::USUAL.value())?;
    let confidence = Confidence::new(confidence).ok().filter(|confidence| confidence.value() > 0.5);
    let confidence = confidence.ok_or_else(|| {
        let text = call.confidence.clone().unwrap_or_default();
        wrong("--confidence", &text, Fault::new("a confidence lies between 50 % and 100 %").help("95 % is usual"))
    })?;
    Ok(Demand {
        confidence,
        good_enough: portion("--good-enough", &call.good_enough, 0.01)?,
        too_much: portion("--too-much", &call.too_much, 0.1)?,
        limit: call.limit.unwrap_or(Call::LIMIT),
        always: call.limit.is_some(),
    })
}

/// The scenario's file. With expectations of the call, none of its own count.
fn base(call: &Call) -> Result<Base, ScenarioError> {
    let (name, source, text) = Scenario::text_of(&call.file)?;
    let expect = if call.expects.is_empty() { Expect::All } else { Expect::Own };
    Ok(Base { name, source, text, expect })
}

/// `figure=condition` as an override: the sign of the comparison may stand for the one between the two.
fn expectation(text: &str) -> Result<(String, String), ScenarioError> {
    let error = || {
        let fault = Fault::new("this is no figure with a condition");
        wrong("--expect", text, fault.help("such as 'latch_skew.p99=<= 500 ns' or 'faults == 0'"))
    };
    let at = text.find(['=', '<', '>', '!']).ok_or_else(error)?;
    let (figure, condition) = text.split_at(at);
    let condition = match condition.strip_prefix('=') {
        // Of "faults == 0" both signs are the comparison's.
        Some(rest) if !rest.starts_with('=') || rest.starts_with("==") => rest,
        _ => condition,
    };
    let (figure, condition) = (figure.trim(), condition.trim());
    if figure.is_empty() || condition.is_empty() {
        return Err(error());
    }
    Ok((format!("expect.{figure}"), condition.to_owned()))
}

/// What is wrong where the search begins, told by the options of this command.
fn blame(mut error: ScenarioError, call: &Call, key: &str, value: &str) -> ToleranceError {
    let varied = format!("--set \"{key}={value}\"");
    for Problem { source, .. } in &mut error.problems {
        if *source == varied {
            let from = call.from.as_ref().map_or_else(String::new, |from| format!(" --from \"{from}\""));
            *source = format!("--vary {key}{from}");
        } else if let Some(expected) = source.strip_prefix("--set \"expect.")
            && !call.sets.iter().any(|(key, value)| *source == format!("--set \"{key}={value}\""))
        {
            *source = format!("--expect \"{expected}");
        }
    }
    error.into()
}

fn nothing_expected(base: &Base) -> ScenarioError {
    let fault = Fault::new("this scenario expects nothing, so that everything would hold").help(
        "--expect 'slave.each.clock_failures == 0', or a table [expect]; isodp figures FILE lists what can be expected",
    );
    ScenarioError::about_file(&base.source, fault)
}
