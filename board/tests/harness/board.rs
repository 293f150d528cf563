//! What tests of complete boards share: measuring from pin to pin.

use takt_board::simulation::Simulation;

/// The ticks of a board that shows them at a pin.
pub(crate) struct Ticks {
    /// A cycle with one.
    first: u64,
    /// Cycles from one to the next.
    period: u32,
}

/// Cycles that are looked through in one go.
const STRETCH: u32 = 1000;

impl Ticks {
    pub(crate) fn of(board: &mut Simulation, period: u32) -> Ticks {
        let mut is_tick = || {
            board.run(1, &[]).expect("it runs");
            board.output("signal_tick").expect("a pin").1 == 1
        };
        assert!((0..2 * period).any(|_| is_tick()), "no tick");
        Ticks { first: board.cycles - 1, period }
    }

    /// Cycles from a change of an input, so many cycles before a tick, to the edge of an output that stands until then.
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
        // An encoder's edge is at a run's end.
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

    /// Runs until a tick comes in so many cycles and so many more.
    pub(crate) fn run_to(&self, board: &mut Simulation, before: u64, more: u32) {
        let period = u64::from(self.period);
        let past = (board.cycles + before + u64::from(more) - self.first) % period;
        board.run((period - past) as u32, &[]).expect("it runs");
    }
}
