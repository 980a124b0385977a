//! Devices: what the profiles say, as text. A list of all, or everything about one.

use super::report::aligned;
use super::scenario::suggestion;
use crate::device::parameters::{PARAMETERS, Parameter};
use crate::device::profile::{self, AcyclicLimits, DxbLimits, PROFILES, Profile};
use crate::time::{BitRate, Span};
use crate::wire::parameter;

/// There is no such device. Reads as a sentence.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("there is no device \"{name}\"; {help}")]
pub struct UnknownDevice {
    name: String,
    help: String,
}

/// All devices: their limits and the longest answer times.
pub fn list() -> String {
    let header =
        ["name", "ident", "in", "out", "T_DP", "T_I from", "T_O - T_DX over", "T_PLL_W to", "resolution", "function"];
    let rows: Vec<_> = PROFILES.iter().map(limits).collect();
    let mut lines = aligned(&header, &[0, 9], &rows);

    let answers =
        |profile: &Profile| std::iter::once(profile.name.to_string()).chain(max_tsdr(profile)).collect::<Vec<_>>();
    let header: Vec<_> = std::iter::once("MaxTsdr [t_bit]").chain(rates()).collect();
    lines.push(String::new());
    lines.extend(aligned(&header, &[0], &PROFILES.iter().map(answers).collect::<Vec<_>>()));

    lines.push(String::new());
    let titles = |profile: &Profile| vec![profile.name.to_string(), profile.title.to_string()];
    lines.extend(aligned(&["name", "what it is"], &[0, 1], &PROFILES.iter().map(titles).collect::<Vec<_>>()));
    lines.push(String::new());
    lines.push("in, out: octets; rates in bit/s; everything about one device: isodp devices NAME".to_owned());
    lines.push("others come from GSD files, device = { gsd = \"FILE\" }; what one says: isodp gsd FILE".to_owned());
    text(&lines)
}

/// Everything about the device called `name`.
///
/// # Errors
/// There is no such device.
pub fn full(name: &str) -> Result<String, UnknownDevice> {
    let Some(profile) = profile::find(name) else {
        let help = suggestion(name, PROFILES.iter().map(|profile| &*profile.name));
        return Err(UnknownDevice { name: name.chars().take(40).collect(), help });
    };
    let mut lines = vec![format!("{}: {}", profile.name, profile.title), String::new()];
    let rows: Vec<_> = facts(profile).into_iter().map(|(what, value)| vec![what.to_owned(), value]).collect();
    lines.extend(aligned(&["", ""], &[0, 1], &rows).into_iter().skip(1));

    lines.extend([String::new(), "MaxTsdr, the longest time to an answer [t_bit], at each rate [bit/s]".to_owned()]);
    lines.extend(aligned(&rates().collect::<Vec<_>>(), &[], &[max_tsdr(profile).collect()]));

    lines.push(String::new());
    if profile.subscriber {
        lines.push("no acyclic parameters".to_owned());
    } else {
        lines.push("acyclic parameters, all read-only (manual 4)".to_owned());
        let rows: Vec<_> = PARAMETERS.iter().flat_map(parameter_rows).collect();
        lines.extend(aligned(&["number", "name", "format"], &[0, 1, 2], &rows));
    }
    Ok(text(&lines))
}

/// The rates without their common unit.
fn rates() -> impl Iterator<Item = &'static str> {
    BitRate::ALL.iter().map(|rate| rate.text().trim_end_matches("bit/s"))
}
/// The longest answer times in the order of the rates.
fn max_tsdr(profile: &Profile) -> impl Iterator<Item = String> {
    profile.max_tsdr.iter().map(|bits| bits.0.to_string())
}

fn limits(profile: &Profile) -> Vec<String> {
    vec![
        profile.name.to_string(),
        format!("{:04X}", profile.ident),
        profile.inputs.to_string(),
        profile.outputs.to_string(),
        format!("{} to {}", profile.t_dp_min, profile.t_dp_max),
        profile.t_i_min(false).to_string(),
        profile.t_o_min.to_string(),
        Span::from_iso_units(profile.t_pll_w_max.into()).to_string(),
        format!("{} x {}", profile.steps_per_rev, profile.revolutions),
        function(profile).to_owned(),
    ]
}

const fn function(profile: &Profile) -> &'static str {
    match (profile.publisher, profile.subscriber) {
        (true, true) => "publisher/subscriber",
        (true, false) => "publisher",
        (false, true) => "subscriber",
        (false, false) => "-",
    }
}

fn links(profile: &Profile) -> String {
    if !profile.subscriber {
        return "none, it does not subscribe".to_owned();
    }
    let DxbLimits { links, data, slots, .. } = profile.dxb;
    format!("up to {links}, samples up to {data} octets; subscriber table: slots 1 to {slots} of {data} octets")
}

/// What acyclic services take of one class of masters.
fn records(limits: AcyclicLimits) -> String {
    format!("records of up to {} octets, answered within {}", limits.max_data, limits.response_timeout)
}

/// What is known of a device, each with its words.
fn facts(profile: &Profile) -> Vec<(&'static str, String)> {
    let octets: Vec<_> = profile.config.iter().map(|octet| format!("{octet:02X}")).collect();
    let with_functions = |least: Span, functions: Span| format!("{least} or more, {functions} with octet 15 bit 1");
    let window = Span::from_iso_units(profile.t_pll_w_max.into());
    vec![
        ("Ident_Number", format!("{:04X}", profile.ident)),
        ("Chk_Cfg octets", octets.join(" ")),
        ("inputs", format!("{} octets from slave to master", profile.inputs)),
        ("outputs", format!("{} octets from master to slave", profile.outputs)),
        ("T_DP", format!("{} to {} in steps of {}", profile.t_dp_min, profile.t_dp_max, profile.dp_grid())),
        ("T_I", with_functions(profile.t_i_min(false), profile.t_i_min(true))),
        ("T_O", format!("more than {} after the end of T_DX", profile.t_o_min)),
        ("T_O to the latch", with_functions(profile.gap_min(false), profile.gap_min(true))),
        ("step of T_I and T_O", profile.io_grid().to_string()),
        ("T_PLL_W", format!("up to {window}; less than {} counts as this", profile.min_window)),
        ("resolution", format!("{} steps in a revolution, {} revolutions", profile.steps_per_rev, profile.revolutions)),
        ("function", function(profile).to_owned()),
        ("links", links(profile)),
        ("empty Data_Exchange", if profile.fail_safe { "means Clear (Fail_Safe)" } else { "is refused" }.to_owned()),
        ("watchdog", if profile.wd_base_1ms { "in steps of 10 ms or 1 ms" } else { "in steps of 10 ms" }.to_owned()),
        ("MS1", if profile.acyclic { records(profile.c1) } else { "none".to_owned() }),
        ("MS2", format!("{} connections at a time, {}", profile.ms2_connections, records(profile.c2))),
        ("source", profile.source.to_string()),
    ]
}

/// A parameter and those of its elements that have a name.
fn parameter_rows(of: &Parameter) -> Vec<Vec<String>> {
    let format = of.format.to_string();
    let count = if of.elements > 0 { format!("{} x {format}", of.elements) } else { format };
    let whole = vec![format!("P{}", of.pnu), parameter::name(of.pnu).to_owned(), count];
    let element = |subindex: usize| {
        let name = parameter::element(of.pnu, subindex as u16);
        vec![format!("P{}[{subindex}]", of.pnu), format!("  {name}"), String::new()]
    };
    let named = |subindex: &usize| parameter::element(of.pnu, *subindex as u16) != parameter::name(of.pnu);
    std::iter::once(whole).chain((0..of.elements).filter(named).map(element)).collect()
}

fn text(lines: &[String]) -> String {
    lines.iter().flat_map(|line| [line.trim_end(), "\n"]).collect()
}
