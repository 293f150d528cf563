// SPDX-License-Identifier: MIT OR Apache-2.0
//! Helpers for tests of complete boards: measuring from pin to pin, and writes that a board must refuse.

use takt_board::Host;
use takt_board::protocol::{self, Line, LinkError, Receiver};
use takt_board::simulation::Simulation;

/// Checks that a write is refused, that no word of it is written, and that a repetition of the request is answered alike.
pub(crate) fn refuses(host: &mut Host<Simulation>, address: u16, words: &[u32]) {
    let was = host.read(address, words.len()).expect("it can be read");
    let error = host.write(address, words).expect_err("it cannot be written");
    assert!(
        matches!(error, LinkError::ReadOnly { address: at, .. } if at == address),
        "{address:#x}: {error}"
    );
    let (mut receiver, mut answers) = (Receiver::default(), Vec::new());
    for _ in 0..2 {
        host.line.send(&protocol::write(0x5f, address, words)).expect("a line");
        for _ in 0..40 {
            receiver.put(&host.line.receive().expect("a line"));
            answers.extend(std::iter::from_fn(|| receiver.frame()).map(|frame| frame.status));
        }
    }
    assert_eq!(answers, [protocol::READ_ONLY; 2], "{address:#x}");
    if is_constant(address) {
        assert_eq!(host.read(address, words.len()).expect("it can be read"), was, "{address:#x}");
    }
}

/// A running program leaves the word at an address unchanged.
fn is_constant(address: u16) -> bool {
    !matches!(address, 2..=3 | 7..=11 | 19 | 0x102 | 0x3400..)
}

/// The ticks of a board that shows them at a pin.
pub(crate) struct Ticks {
    /// The number of a cycle with a tick.
    first: u64,
    /// Cycles from a tick to the next.
    period: u32,
}

/// Cycles that a simulation runs between two looks at the output.
pub(crate) const STRETCH: u32 = 1000;

impl Ticks {
    pub(crate) fn of(board: &mut Simulation, period: u32) -> Ticks {
        let mut is_tick = || {
            board.run(1, &[]).expect("it runs");
            board.output("signal_tick").expect("a pin").1 == 1
        };
        assert!((0..2 * period).any(|_| is_tick()), "no tick");
        Ticks { first: board.cycles - 1, period }
    }

    /// Cycles from a change of an input, `before` cycles before a tick, to the edge of an output that stands until then.
    pub(crate) fn measured(
        &self,
        board: &mut Simulation,
        before: u64,
        change: impl FnOnce(&mut Simulation),
        output: &str,
    ) -> u64 {
        self.run_to(board, before, 0);
        let was = board.output(output).expect("a pin").0;
        change(board);
        // The edge of an encoder is at the end of a run.
        board.run(1, &[]).expect("it runs");
        let mut cycles = 1;
        for _ in 0..20 * self.period / STRETCH {
            board.run(STRETCH, &[]).expect("it runs");
            let (level, high) = board.output(output).expect("a pin");
            cycles += u64::from(if was { high } else { STRETCH - high });
            if level != was {
                return cycles;
            }
        }
        panic!("{output} does not follow");
    }

    /// Runs until the next tick comes `before` and `more` cycles later.
    pub(crate) fn run_to(&self, board: &mut Simulation, before: u64, more: u32) {
        let period = u64::from(self.period);
        let past = (board.cycles + before + u64::from(more) - self.first) % period;
        board.run((period - past) as u32, &[]).expect("it runs");
    }
}
