//! What is wrong with a scenario, and where: sentences with file, line, column, the rule, and what would be right.

use std::fmt;

/// A scenario that cannot be read or breaks a rule. Displays as one paragraph per problem.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ScenarioError {
    /// Everything that is wrong, in the order of the file, never empty.
    pub problems: Vec<Problem>,
}

/// One thing that is wrong.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Problem {
    /// The file, or `--set` with the assignment.
    pub source: String,
    /// Where in the file, if one place is to blame.
    pub position: Option<Position>,
    /// The key's path, such as `slave.3.t_o`; empty if the problem is not about a key.
    pub key: String,
    /// What is wrong.
    pub fault: Fault,
}

/// A place in a file.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Position {
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1 (characters).
    pub column: usize,
    /// How many characters of the line are to blame, at least 1.
    pub width: usize,
    /// The whole line.
    pub text: String,
}

/// What is wrong, without its place.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Fault {
    /// What is wrong, with the value.
    pub message: String,
    /// The rule with its source and its numbers; may be empty.
    pub rule: String,
    /// What would be right; may be empty.
    pub help: String,
}

impl Fault {
    /// A fault that `message` says.
    pub(in crate::study) fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), ..Self::default() }
    }
    /// The same with the rule that it breaks.
    pub(in crate::study) fn rule(self, rule: impl Into<String>) -> Self {
        Self { rule: rule.into(), ..self }
    }
    /// The same with what would be right.
    pub(in crate::study) fn help(self, help: impl Into<String>) -> Self {
        Self { help: help.into(), ..self }
    }
}

impl ScenarioError {
    /// An error about a whole file.
    pub(in crate::study) fn about_file(source: &str, fault: Fault) -> Self {
        Self { problems: vec![Problem { source: source.into(), position: None, key: String::new(), fault }] }
    }
}

impl fmt::Display for ScenarioError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, problem) in self.problems.iter().enumerate() {
            if i > 0 {
                f.write_str("\n\n")?;
            }
            problem.fmt(f)?;
        }
        Ok(())
    }
}
impl std::error::Error for ScenarioError {}
impl std::error::Error for Problem {}

/// Longest line that is shown (characters).
const SHOWN: usize = 160;

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.source)?;
        if let Some(Position { line, column, .. }) = &self.position {
            write!(f, ":{line}:{column}")?;
        }
        f.write_str(": ")?;
        if !self.key.is_empty() {
            write!(f, "{}: ", self.key)?;
        }
        f.write_str(&self.fault.message)?;
        if let Some(position) = &self.position
            && position.text.chars().count() <= SHOWN
        {
            let number = position.line.to_string();
            let (gutter, before, width) = (number.len(), position.column - 1, position.width);
            // Tabs stay tabs under tabs, so that the caret stands where the value does.
            let indent: String =
                position.text.chars().take(before).map(|c| if c == '\t' { '\t' } else { ' ' }).collect();
            write!(f, "\n  {number} | {}\n  {:gutter$} | {indent}{}", position.text, "", "^".repeat(width))?;
        }
        for (title, text) in [("rule", &self.fault.rule), ("help", &self.fault.help)] {
            if !text.is_empty() {
                write!(f, "\n  {title}: {text}")?;
            }
        }
        Ok(())
    }
}
