//! Output files of all programs of this workspace. A file with its final name is complete; after an error or an interrupt, none
//! that this process has begun remains; a file that another run has made is never removed.
//!
//! - [`open`] and [`read`] open inputs; no output may be one of them, also under another name.
//! - [`Draft`] is a file, [`write_atomically`] writes one in one call. Devices and FIFOs are written through.
//! - [`Claim`] is a directory of files that become visible together, with the last of them.
//! - [`Heap`] is the allocator of a program that ends when it gets no more memory.
//! - [`interrupt::install`] makes signals remove whatever is unfinished and end the process.

pub mod interrupt;
mod outputs;
mod unfinished;
mod uses;

pub use interrupt::{Heap, OUT_OF_MEMORY};
pub use outputs::{Claim, Draft, check_writable, write_atomically};
pub use uses::{
    append_log, clash, folder_of, name_output, open, read, read_log, read_text, register_input,
    register_output,
};

use std::fmt::Display;

/// Exit code of a program with a bug: it panicked.
pub const BUG: i32 = 70;

/// Greatest length of a message in characters: about a screen.
const SCREEN: usize = 1600;

/// Text that others have written, without the characters that move the cursor, turn the direction of a line or worse: of control characters,
/// only ends of lines and tabs remain.
pub fn plain(text: &dyn Display) -> String {
    let turns = |c| matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let hides = |c: char| turns(c) || c.is_control() && c != '\n' && c != '\t';
    text.to_string().replace(hides, "\u{fffd}")
}

/// A message without control characters, of at most a screen.
pub fn message(text: &dyn Display) -> String {
    let text = plain(text);
    let Some((end, _)) = text.char_indices().nth(SCREEN) else { return text };
    let (shown, rest) = text.split_at(end);
    format!("{shown} ... ({} characters more)", rest.chars().count())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_replaced() {
        let (escape, next_line) = ("\x1b[2J\r\x07", "\u{9b}");
        let text = message(&format_args!("a{escape}b\tc\n{next_line}ä"));
        assert_eq!(text, "a\u{fffd}[2J\u{fffd}\u{fffd}b\tc\n\u{fffd}ä");
        // From here on, a terminal would show a line from right to left.
        let [turned, isolated] = ["lts.\u{202e}exe", "a\u{2067}b\u{2069}"].map(|text| plain(&text));
        assert_eq!([turned, isolated], ["lts.\u{fffd}exe", "a\u{fffd}b\u{fffd}"]);
    }

    #[test]
    fn a_message_is_at_most_a_screen() {
        assert_eq!(message(&"ä".repeat(SCREEN)), "ä".repeat(SCREEN));
        let long = message(&"ä".repeat(SCREEN + 3));
        assert!(long.ends_with("ä ... (3 characters more)") && long.chars().count() < SCREEN + 40);
    }
}
