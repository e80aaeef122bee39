//! Text that others have written, as it may be shown on a terminal.

use std::fmt::{self, Display, Write};

/// Greatest length of a message in characters: about a screen.
const SCREEN: usize = 1600;

/// A writer that replaces control characters, which move the cursor or worse, except ends of lines and tabs.
pub struct Plain<W>(pub W);

impl<W: Write> Write for Plain<W> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let is_shown = |c: char| !c.is_control() || c == '\n' || c == '\t';
        text.chars().try_for_each(|c| self.0.write_char(if is_shown(c) { c } else { '\u{fffd}' }))
    }
}

/// A message without control characters, of at most a screen.
pub fn message(text: &dyn Display) -> String {
    let mut plain = Plain(String::new());
    // Only the text itself can fail.
    let _ = write!(plain, "{text}");
    let Plain(mut text) = plain;
    if let Some((end, _)) = text.char_indices().nth(SCREEN) {
        let rest = text[end..].chars().count();
        text.truncate(end);
        let _ = write!(text, " ... ({rest} characters more)");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_replaced() {
        let (escape, next_line) = ("\x1b[2J\r\x07", "\u{9b}");
        let text = message(&format_args!("a{escape}b\tc\n{next_line}ä"));
        assert_eq!(text, "a\u{fffd}[2J\u{fffd}\u{fffd}b\tc\n\u{fffd}ä");
    }

    #[test]
    fn a_message_is_at_most_a_screen() {
        assert_eq!(message(&"ä".repeat(SCREEN)), "ä".repeat(SCREEN));
        let long = message(&"ä".repeat(SCREEN + 3));
        assert!(long.ends_with("ä ... (3 characters more)") && long.chars().count() < SCREEN + 40);
    }
}
