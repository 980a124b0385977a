//! From the octets of a file to lines of words: Latin-1, comments, continuation lines.

use super::Wrong;

/// A place in the file.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) struct At {
    /// Line, from 1.
    pub(super) line: usize,
    /// Column, from 1 (characters).
    pub(super) column: usize,
    /// How many characters of the line it is about.
    pub(super) width: usize,
}

/// What a token is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Kind {
    /// A keyword, a number or a name.
    Word,
    /// A text in quotation marks, which it is without.
    Text,
    /// One of `= ( ) , - @`.
    Sign,
}

/// The smallest part of a statement.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Token {
    pub(super) kind: Kind,
    pub(super) text: String,
    pub(super) at: At,
}

impl Token {
    /// Whether it is this sign.
    pub(super) fn is(&self, sign: &str) -> bool {
        self.kind == Kind::Sign && self.text == sign
    }
    /// Whether it is this keyword, in capitals or not.
    pub(super) fn is_keyword(&self, keyword: &str) -> bool {
        self.kind == Kind::Word && self.text.eq_ignore_ascii_case(keyword)
    }
}

/// The tokens of one line with its continuations; never empty.
pub(super) type Line = Vec<Token>;

/// What may stand alone between words.
const SIGNS: &str = "=(),-@";
/// The keyword with which the description begins.
const START: &str = "#Profibus_DP";

/// The lines of the file as characters. Octets above 7F are Latin-1, unless the whole file is UTF-8.
pub(super) fn decode(octets: &[u8]) -> Result<Vec<String>, Wrong> {
    let octets = octets.strip_prefix(&[0xEF, 0xBB, 0xBF]).unwrap_or(octets);
    // Ctrl-Z ends the texts of old systems.
    let octets = octets.split(|&octet| octet == 0x1A).next().unwrap_or_default();
    if let Some(at) = octets.iter().position(|&octet| octet < 0x20 && !matches!(octet, b'\t' | b'\n' | 0x0C | b'\r')) {
        let line = octets[..at].split(|&octet| octet == b'\n').count();
        return Err(Wrong::in_line(line, format!("this is no text: octet {:02X} in line {line}", octets[at]))
            .help("a GSD file is a text file in Latin-1; save it so"));
    }
    let text = match std::str::from_utf8(octets) {
        Ok(text) => text.to_owned(),
        Err(_) => octets.iter().map(|&octet| char::from(octet)).collect(),
    };
    // What is left of the control characters would change a terminal.
    let shown = |c: char| if matches!(c, '\u{7F}'..='\u{9F}') { '\u{FFFD}' } else { c };
    let text: String = text.replace("\r\n", "\n").replace('\r', "\n").chars().map(shown).collect();
    Ok(text.split('\n').map(str::to_owned).collect())
}

/// The statements after [`START`], line by line.
pub(super) fn tokens(lines: &[String]) -> Result<Vec<Line>, Wrong> {
    let is_start = |line: &String| line.split(';').next().unwrap_or_default().trim().eq_ignore_ascii_case(START);
    let Some(start) = lines.iter().position(is_start) else {
        return Err(Wrong::of_file(format!("there is no line {START}"))
            .rule(format!("the description of a slave begins with a line {START} (GSD specification)"))
            .help("is this a GSD file for PROFIBUS DP?"));
    };
    let mut lexer = Lexer::default();
    for (index, line) in lines.iter().enumerate().skip(start + 1) {
        lexer.line(index + 1, line)?;
    }
    if let Some(open) = lexer.open {
        return Err(unclosed(open.at));
    }
    lexer.end_of_line();
    Ok(lexer.done)
}

#[derive(Default)]
struct Lexer {
    done: Vec<Line>,
    /// The statement so far.
    line: Line,
    /// A text that goes on in the next line.
    open: Option<Token>,
}

impl Lexer {
    fn end_of_line(&mut self) {
        if !self.line.is_empty() {
            self.done.push(std::mem::take(&mut self.line));
        }
    }
    /// Takes one line of the file.
    fn line(&mut self, number: usize, text: &str) -> Result<(), Wrong> {
        let chars: Vec<char> = text.chars().collect();
        let mut at = 0;
        if let Some(open) = self.open.take() {
            at = self.text(open, &chars, 0)?;
        }
        while let Some(&c) = chars.get(at) {
            let place = |width| At { line: number, column: at + 1, width };
            match c {
                ';' => break,
                '"' => {
                    let token = Token { kind: Kind::Text, text: String::new(), at: place(1) };
                    at = self.text(token, &chars, at + 1)?;
                }
                '\\' => {
                    let rest = chars[at + 1..].iter().find(|c| !c.is_whitespace());
                    if rest.is_some_and(|&c| c != ';') {
                        return Err(Wrong::at(place(1), "a backslash within a line")
                            .rule("\\ at the end of a line continues it in the next (GSD specification)")
                            .help("leave it out, or put a line break after it"));
                    }
                    return Ok(());
                }
                c if c.is_whitespace() => at += 1,
                c if SIGNS.contains(c) => {
                    self.line.push(Token { kind: Kind::Sign, text: c.to_string(), at: place(1) });
                    at += 1;
                }
                _ => {
                    let ends = |&c: &char| c.is_whitespace() || SIGNS.contains(c) || matches!(c, ';' | '"' | '\\');
                    let width = chars[at..].iter().position(ends).unwrap_or(chars.len() - at);
                    let text = chars[at..at + width].iter().collect();
                    self.line.push(Token { kind: Kind::Word, text, at: place(width) });
                    at += width;
                }
            }
        }
        // A text that is still open keeps its statement open.
        if self.open.is_none() {
            self.end_of_line();
        }
        Ok(())
    }
    /// Reads on in the text `token` from `from` on; where it ends.
    fn text(&mut self, mut token: Token, chars: &[char], from: usize) -> Result<usize, Wrong> {
        let end = chars[from..].iter().position(|&c| c == '"').map(|length| from + length);
        if let Some(end) = end {
            token.text.extend(&chars[from..end]);
            token.at.width = token.text.chars().count() + 2;
            self.line.push(token);
            return Ok(end + 1);
        }
        let rest: String = chars[from..].iter().collect();
        let Some(continued) = rest.trim_end().strip_suffix('\\') else { return Err(unclosed(token.at)) };
        token.text.push_str(continued);
        self.open = Some(token);
        Ok(chars.len())
    }
}

fn unclosed(at: At) -> Wrong {
    Wrong::at(at, "this text has no end").help("close it with a quotation mark in its own line")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<String> {
        let lines = tokens(&decode(text.as_bytes()).expect("a text")).expect("good lines");
        lines.iter().map(|line| line.iter().map(|t| t.text.as_str()).collect::<Vec<_>>().join("|")).collect()
    }

    #[test]
    fn lines_lose_comments_and_join_with_their_continuations() {
        let text = "any text, \"even this\n  #PROFIBUS_dp ; here\r\na = 1 ; b = 2\rT(1)=\"x;y\"\n\nc=0x01,\\\n\t0x02,\\ \n -3\n\
                    d=\"one \\\ntwo\" ; end\n";
        assert_eq!(words(text), ["a|=|1", "T|(|1|)|=|x;y", "c|=|0x01|,|0x02|,|-|3", "d|=|one two"]);
    }

    #[test]
    fn octets_are_latin_1_unless_all_are_utf_8() {
        let latin = decode(b"M\xFCnchen \x85 5 \xB5s\x1A\0rest").expect("a text");
        assert_eq!(latin, ["M\u{FC}nchen \u{FFFD} 5 \u{B5}s"]);
        assert_eq!(decode("\u{FEFF}5 \u{B5}s".as_bytes()).expect("a text"), ["5 \u{B5}s"]);
        let wrong = decode(b"a\nb\0").expect_err("no text");
        assert_eq!(
            (wrong.at.map(|at| at.line), wrong.fault.message.as_str()),
            (Some(2), "this is no text: octet 00 in line 2")
        );
    }

    #[test]
    fn what_is_no_line_is_told_with_its_place() {
        let wrong = |text: &str| {
            let wrong = tokens(&decode(text.as_bytes()).expect("a text")).expect_err("a wrong line");
            (wrong.at.map(|at| (at.line, at.column)), wrong.fault.message)
        };
        assert_eq!(wrong("GSD_Revision = 1"), (None, "there is no line #Profibus_DP".to_owned()));
        assert_eq!(wrong("#Profibus_DP\na = \"b"), (Some((2, 5)), "this text has no end".to_owned()));
        assert_eq!(wrong("#Profibus_DP\na = \"b\\"), (Some((2, 5)), "this text has no end".to_owned()));
        assert_eq!(wrong("#Profibus_DP\na \\ b"), (Some((2, 3)), "a backslash within a line".to_owned()));
    }
}
