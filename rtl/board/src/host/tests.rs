// SPDX-License-Identifier: MIT OR Apache-2.0
//! The host's end of the line with misbehaving boards.

use super::*;
use crate::protocol::{BUSY, DONE, MAGIC, READ_ONLY, id};

/// A board's answer to a request: status and words, from the request's bytes.
type Answers = fn(&[u8]) -> Option<(u8, Vec<u32>)>;

/// A board that sends a byte at a time, or endless noise.
#[derive(Debug)]
struct ScriptedBoard {
    bytes: VecDeque<u8>,
    noise: bool,
    sent: u32,
    heard: u32,
    answers: Answers,
}

impl Line for ScriptedBoard {
    fn send(&mut self, request: &[u8]) -> std::io::Result<()> {
        self.sent += 1;
        if let Some((status, words)) = (self.answers)(request).filter(|_| !self.noise) {
            self.bytes = protocol::answer(request[1], status, &words).into();
        }
        Ok(())
    }

    fn receive(&mut self) -> std::io::Result<Vec<u8>> {
        self.heard += 1;
        Ok(if self.noise { vec![0x11; 16] } else { self.bytes.pop_front().into_iter().collect() })
    }

    fn patience(&self) -> u32 {
        2
    }

    fn time(&self) -> Duration {
        Duration::from_millis(100 * u64::from(self.heard))
    }
}

fn slow(answers: Answers) -> ScriptedBoard {
    ScriptedBoard { bytes: VecDeque::new(), noise: false, sent: 0, heard: 0, answers }
}

/// Words of a correct board: its `id`, 1 (running) in `control`, and 0 elsewhere.
fn right(request: &[u8]) -> Option<(u8, Vec<u32>)> {
    let words = if request[2] == 1 { usize::from(request[3]) } else { 0 };
    let first = match request[4..6] {
        [0, 0] => id(1),
        [low, 0] => u32::from(u16::from(low) == address("control")),
        _ => 0,
    };
    Some((DONE, vec![first; words]))
}

fn connected(answers: Answers) -> Host<ScriptedBoard> {
    let mut host = Host::connect(slow(right), 1).unwrap();
    host.line.answers = answers;
    host.line.sent = 0;
    host
}

#[test]
fn flags_of_a_status() {
    let all = [(7, Flags::OVERFLOW), (8, Flags::DIVIDE_BY_ZERO), (9, Flags::INVALID)];
    assert!(all.iter().all(|(bit, flag)| Status(1 << bit | 5).flags() == *flag));
    assert_eq!((Status(6 << 4 | 4).flags(), Status(6 << 4 | 4).fault_slot()), (Flags::NONE, 6));
}

#[test]
fn an_answer_may_come_in_any_number_of_pieces() {
    let host = Host::connect(slow(right), 1).unwrap();
    assert_eq!((host.retries, host.line.sent), (0, 2));
}

#[test]
fn noise_without_end_is_no_answer() {
    let error = Host::connect(ScriptedBoard { noise: true, ..slow(right) }, 1).unwrap_err();
    assert!(matches!(error, LinkError::Silence(ATTEMPTS)), "{error}");
}

/// A wrong number of words is retried, but only up to the limit.
#[test]
fn another_number_of_words_is_no_answer() {
    for (answers, came) in [
        ((|_| Some((DONE, vec![]))) as Answers, 0),
        (|request| Some((DONE, vec![7; usize::from(request[3]) - 1])), 15),
    ] {
        let mut host = connected(answers);
        let error = host.read(protocol::IMAGE, 100).unwrap_err();
        let LinkError::Words { wanted: 16, came: words, attempts: ATTEMPTS } = error else {
            panic!("{error}");
        };
        assert_eq!((words, host.line.sent), (came, ATTEMPTS));
    }
    let mut host = connected(|_| Some((DONE, vec![7; 3])));
    let error = host.set("control", 0).unwrap_err();
    assert!(matches!(error, LinkError::Words { wanted: 0, came: 3, .. }), "{error}");
    assert_eq!(host.line.sent, ATTEMPTS);
}

/// Occasional bytes do not count as silence, but a request still ends.
#[test]
fn sparse_bytes_end_at_the_time_limit() {
    let mut host = connected(|_| None);
    host.line.bytes = vec![0x11; 1 << 20].into();
    let before = host.line.time();
    assert!(matches!(host.register("status"), Err(LinkError::Silence(ATTEMPTS))));
    assert!(host.line.time() - before <= LIMIT + Duration::from_secs(1));
}

/// A request that waits for the program leaves the board time to refuse.
#[test]
fn a_late_refusal_is_heard() {
    let mut host = connected(|_| None);
    host.read(address("status"), 1).unwrap_err();
    let short = host.line.heard;
    host.read(protocol::OUTPUTS, 1).unwrap_err();
    assert!(host.line.heard - short > GRANT, "{}", host.line.heard - short);
    let mut host = connected(|_| Some((BUSY, vec![])));
    assert!(matches!(host.read(protocol::OUTPUTS, 1), Err(LinkError::Busy)));
}

#[test]
fn refusals_of_a_board_are_errors() {
    let mut host = connected(|_| Some((READ_ONLY, vec![])));
    let error = host.write(protocol::OUTPUTS + 3, &[1, 2]).unwrap_err();
    assert!(matches!(error, LinkError::ReadOnly { address: 0x2003, words: 2 }), "{error}");
    assert_eq!(host.line.sent, 1);
    let mut host = connected(|_| Some((9, vec![])));
    assert!(matches!(host.register("id"), Err(LinkError::Status(9))));
}

#[test]
fn limits_polls_of_a_program_that_never_waits() {
    let mut host = connected(right);
    assert!(matches!(host.settle(), Err(LinkError::Busy)));
    assert_eq!(host.line.sent, 1 + ASKED);
}

#[test]
fn a_board_has_as_many_cores_as_there_can_be() {
    let answers: [(Answers, usize); 3] = [
        (|_| Some((DONE, vec![id(0)])), 0),
        (|_| Some((DONE, vec![id(17)])), 17),
        (|_| Some((DONE, vec![id(0xff)])), 0xff),
    ];
    for (answers, cores) in answers {
        let error = Host::connect(slow(answers), 1).unwrap_err();
        assert!(matches!(error, LinkError::Cores(known) if known == cores), "{error}");
    }
    let error = Host::connect(slow(|_| Some((DONE, vec![MAGIC << 16 | 1 << 8 | 1]))), 1).unwrap_err();
    assert!(matches!(error, LinkError::Version(1)), "{error}");
    let error = Host::connect(slow(|_| Some((DONE, vec![0x5441_4b54]))), 1).unwrap_err();
    assert!(matches!(error, LinkError::Stranger(0x5441_4b54)), "{error}");
}
