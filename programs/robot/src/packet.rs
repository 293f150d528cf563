// SPDX-License-Identifier: MIT OR Apache-2.0
//! The words between host and communication core: packets with a checksum, and reports. One table for each kind of number;
//! `programs/three/packets.s` has the same as constants, and a test compares the two.

use std::fmt;

/// Tags of a packet: bits 31 to 24 of its first word.
pub const MAGIC: u32 = 0x54;
/// Words of a packet besides its payload: header, sequence number, checksum.
pub const FRAME_WORDS: usize = 3;
/// Payload words at most.
pub const PAYLOAD_WORDS: usize = 12;
/// [`Motion::flags`]: goes on into the next segment without stopping.
pub const FLAG_VIA: u32 = 1;
/// [`Motion::flags`]: say whether it is possible and how long it takes, and do not move.
pub const FLAG_CHECK: u32 = 2;

/// Declares an enumeration whose numbers go over the link.
macro_rules! numbers {
    ($(#[$meta:meta])* $name:ident { $($(#[$row:meta])* $variant:ident = $number:literal, $text:literal;)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum $name { $($(#[$row])* $variant = $number,)* }

        impl $name {
            /// All of them, by number.
            pub const ALL: &[$name] = &[$($name::$variant),*];

            /// The one of this number.
            pub fn of(number: u32) -> Option<$name> {
                match number { $($number => Some($name::$variant),)* _ => None }
            }

            /// Its number on the link.
            pub const fn number(self) -> u32 {
                self as u32
            }

            /// Its name for people.
            pub const fn text(self) -> &'static str {
                match self { $($name::$variant => $text,)* }
            }

            /// The name of its row.
            pub const fn name(self) -> &'static str {
                match self { $($name::$variant => stringify!($variant),)* }
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.text())
            }
        }
    };
}

numbers! {
    /// Kinds of packets.
    Kind {
        /// Nothing: the host is there.
        Nop = 0, "no operation";
        /// Motion in joint space.
        Move = 1, "motion in joint space";
        /// Motion along a line in the world.
        MoveL = 2, "motion along a line";
        /// Rates that are held.
        Jog = 3, "jog";
        /// Along the path, as fast as the limits allow.
        Stop = 4, "stop";
        /// Digital outputs, when the queue has come to it.
        Output = 5, "digital outputs";
        /// An analogue output.
        Level = 6, "analogue output";
        /// Ends the state after an error.
        Reset = 7, "reset";
        /// The tool's point in the flange's frame.
        Tool = 8, "tool";
        /// Limits of velocities and torques.
        Limits = 9, "limits";
    }
}

impl Kind {
    /// Payload words.
    pub const fn words(self) -> usize {
        match self {
            Kind::Nop | Kind::Stop | Kind::Reset => 0,
            Kind::Move | Kind::MoveL => 10,
            Kind::Jog => 7,
            Kind::Output | Kind::Level => 2,
            Kind::Tool => 3,
            Kind::Limits => PAYLOAD_WORDS,
        }
    }
}

numbers! {
    /// Profiles of the acceleration over a segment's time.
    Profile {
        /// Constant forward, then constant back.
        Rectangular = 0, "rectangular";
        /// With ramps.
        Trapezoidal = 1, "trapezoidal";
        /// Parabolas.
        Parabolic = 2, "parabolic";
        /// A cosine's.
        Cosine = 3, "cosine";
    }
}

numbers! {
    /// Meanings of a motion's amount.
    How {
        /// The time, s.
        Time = 0, "time";
        /// The speed: of the fastest joint, rad/s; along the line, m/s, or rad/s if it has no length.
        Speed = 1, "speed";
        /// Nothing: as fast as the limits allow.
        Fast = 2, "fast";
    }
}

numbers! {
    /// Meanings of a jog's rates.
    JogMode {
        /// Of the joints, rad/s.
        Joints = 0, "joints";
        /// Of the tool, along and about the world's axes, m/s and rad/s.
        World = 1, "world";
        /// Of the tool, along and about its own axes.
        Gripper = 2, "gripper";
    }
}

numbers! {
    /// Kinds of reports.
    ReportKind {
        /// Taken into the queue; the value is its time in s.
        Accepted = 1, "accepted";
        /// It begins.
        Started = 2, "started";
        /// It has ended.
        Finished = 3, "finished";
        /// Not taken.
        Refused = 4, "refused";
        /// The robot has stopped or is stopping, because of the cause.
        Stopped = 5, "stopped";
        /// After power-up or reset.
        Ready = 6, "ready";
        /// Possible; the value is its time in s.
        Checked = 7, "possible";
    }
}

numbers! {
    /// Reasons for which a packet was refused or the robot stopped.
    Cause {
        /// The checksum is wrong.
        Crc = 1, "a packet's checksum is wrong";
        /// The sequence number is not the last one's successor.
        Sequence = 2, "a packet is missing or out of order";
        /// Magic, kind or length: it stops. Of a motion or a jog, a profile, a mode or flags that are not defined: refused.
        Header = 3, "a packet's header, kind or length is wrong";
        /// Begun, and its words did not come.
        Late = 4, "a packet was begun and did not arrive in time";
        /// Silent while the robot moves.
        Silent = 5, "the host was silent while the robot moved";
        /// A value is NaN or infinite.
        NotFinite = 6, "a value is not a finite number";
        /// The value is the joint.
        JointLimit = 7, "a joint would leave its range";
        /// No joint angles lead there.
        Unreachable = 8, "the target is out of reach";
        /// At or near a singularity.
        Singular = 9, "the path comes too close to a singularity";
        /// The value is the joint.
        VelocityLimit = 10, "a joint would be too fast";
        /// The value is the joint.
        TorqueLimit = 11, "a drive would need too much torque";
        /// The ring of segments is full.
        QueueFull = 12, "the queue is full";
        /// Only a reset is taken.
        StoppedState = 13, "the robot stands after an error: reset it";
        /// The value is the joint.
        Tracking = 14, "a joint does not follow its reference";
        /// Nothing came after a motion that was to go on.
        RanDry = 15, "no motion followed one that was to go on without stopping";
        /// It needs another state of motion.
        NotWhileMoving = 16, "not while the robot moves";
        /// A core missed its period.
        Deadline = 17, "a core missed its period";
    }
}

impl Cause {
    /// True if a report's value is the number of a joint, from 1.
    pub const fn has_joint(self) -> bool {
        matches!(
            self,
            Cause::JointLimit
                | Cause::VelocityLimit
                | Cause::TorqueLimit
                | Cause::Tracking
                | Cause::NotFinite
        )
    }
}

/// The manner of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// The acceleration's profile.
    pub profile: Profile,
    /// The meaning of `amount`.
    pub how: How,
    /// Time or speed.
    pub amount: f32,
    /// True if it goes on into the next motion.
    pub via: bool,
    /// True if it is only checked.
    pub check: bool,
}

impl Motion {
    /// The word of flags.
    pub const fn flags(self) -> u32 {
        (if self.via { FLAG_VIA } else { 0 }) | (if self.check { FLAG_CHECK } else { 0 })
    }
}

/// A command of the host. SI units; NaN among a motion's targets stands for "as it is".
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// The host is there.
    Nop,
    /// Joint angles.
    Move {
        /// rad.
        joints: [f32; 6],
        /// The manner of the motion.
        motion: Motion,
    },
    /// A line to a pose.
    MoveL {
        /// x, y, z, roll, pitch, yaw.
        pose: [f32; 6],
        /// The manner of the motion.
        motion: Motion,
    },
    /// Rates until the next jog; all 0 ends it.
    Jog {
        /// Of what.
        mode: JogMode,
        /// rad/s; or m/s three times, rad/s three times.
        rates: [f32; 6],
    },
    /// At once.
    Stop,
    /// Digital outputs.
    Output {
        /// Which.
        mask: u32,
        /// Their values.
        bits: u32,
    },
    /// An analogue output.
    Level {
        /// 1 or 2.
        channel: u32,
        /// Its value.
        value: f32,
    },
    /// Ends the state after an error.
    Reset,
    /// The tool's point in the flange's frame, m.
    Tool([f32; 3]),
    /// Limits.
    Limits {
        /// rad/s.
        velocities: [f32; 6],
        /// N·m.
        torques: [f32; 6],
    },
}

impl Command {
    /// Its kind.
    pub const fn kind(&self) -> Kind {
        match self {
            Command::Nop => Kind::Nop,
            Command::Move { .. } => Kind::Move,
            Command::MoveL { .. } => Kind::MoveL,
            Command::Jog { .. } => Kind::Jog,
            Command::Stop => Kind::Stop,
            Command::Output { .. } => Kind::Output,
            Command::Level { .. } => Kind::Level,
            Command::Reset => Kind::Reset,
            Command::Tool(_) => Kind::Tool,
            Command::Limits { .. } => Kind::Limits,
        }
    }

    fn payload(&self) -> Vec<u32> {
        let floats = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        match self {
            Command::Nop | Command::Stop | Command::Reset => Vec::new(),
            Command::Move { joints: target, motion } | Command::MoveL { pose: target, motion } => {
                let mut words = floats(target);
                words.extend([motion.profile.number(), motion.how.number()]);
                words.extend([motion.amount.to_bits(), motion.flags()]);
                words
            }
            Command::Jog { mode, rates } => [vec![mode.number()], floats(rates)].concat(),
            Command::Output { mask, bits } => vec![*mask, *bits],
            Command::Level { channel, value } => vec![*channel, value.to_bits()],
            Command::Tool(point) => floats(point),
            Command::Limits { velocities, torques } => [floats(velocities), floats(torques)].concat(),
        }
    }

    /// The packet's words.
    pub fn encode(&self, sequence: u32) -> Vec<u32> {
        let payload = self.payload();
        let header = MAGIC << 24 | self.kind().number() << 16 | payload.len() as u32;
        let mut words = vec![header, sequence];
        words.extend(payload);
        words.push(checksum(&words));
        words
    }
}

/// CRC-32 (IEEE 802.3, as zlib has it) of words, each with its least significant byte first.
pub fn checksum(words: &[u32]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    for word in words {
        hasher.update(&word.to_le_bytes());
    }
    hasher.finalize()
}

/// An answer of the communication core.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// The kind of answer.
    pub kind: ReportKind,
    /// The packet that it answers; 0 if none.
    pub sequence: u32,
    /// The reason, if there is one.
    pub cause: Option<Cause>,
    /// A time in s, or what explains the cause.
    pub value: f32,
}

/// Words that are no report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReportError {
    /// There is no such kind.
    #[error("a report of the unknown kind {0}")]
    Kind(u32),
    /// There is no such cause.
    #[error("a report with the unknown cause {0}")]
    Cause(u32),
}

impl Report {
    /// Reads the fields `report`, `sequence`, `cause`, `value`.
    ///
    /// # Errors
    /// If kind or cause is unknown.
    pub fn decode([kind, sequence, cause, value]: [u32; 4]) -> Result<Report, ReportError> {
        let kind = ReportKind::of(kind).ok_or(ReportError::Kind(kind))?;
        let cause = match cause {
            0 => None,
            number => Some(Cause::of(number).ok_or(ReportError::Cause(number))?),
        };
        Ok(Report { kind, sequence, cause, value: f32::from_bits(value) })
    }

    /// The joint that the value names, from 1.
    pub fn joint(&self) -> Option<u32> {
        let joint = self.value as u32;
        (self.cause.is_some_and(Cause::has_joint) && (1..=6).contains(&joint)).then_some(joint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAST: Motion =
        Motion { profile: Profile::Cosine, how: How::Time, amount: 2.0, via: true, check: false };

    /// The checksums are Python's `zlib.crc32`.
    #[test]
    fn packets_as_python_makes_them() {
        assert_eq!(Command::Nop.encode(1), [0x5400_0000, 1, 0x100d_d107]);
        assert_eq!(Command::Stop.encode(2), [0x5404_0000, 2, 0x9929_3cff]);
        let joints = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5];
        let words = Command::Move { joints, motion: FAST }.encode(3);
        assert_eq!(words[..3], [0x5401_000a, 3, 0]);
        assert_eq!(words[8..], [3, 0, 0x4000_0000, 1, 0xdcb8_b409]);
        let jog = Command::Jog { mode: JogMode::World, rates: [0.05, 0.0, 0.0, 0.0, 0.0, 0.0] };
        assert_eq!(jog.encode(u32::MAX).last(), Some(&0x6bae_59c1));
    }

    #[test]
    fn payloads_have_the_tables_lengths() {
        let motion = FAST;
        let all = [
            Command::Nop,
            Command::Move { joints: [0.0; 6], motion },
            Command::MoveL { pose: [0.0; 6], motion },
            Command::Jog { mode: JogMode::Joints, rates: [0.0; 6] },
            Command::Stop,
            Command::Output { mask: 1, bits: 1 },
            Command::Level { channel: 1, value: 0.5 },
            Command::Reset,
            Command::Tool([0.0; 3]),
            Command::Limits { velocities: [1.0; 6], torques: [1.0; 6] },
        ];
        assert_eq!(all.len(), Kind::ALL.len());
        for (command, kind) in all.iter().zip(Kind::ALL) {
            assert_eq!(command.kind(), *kind);
            assert_eq!(command.payload().len(), kind.words());
            assert!(kind.words() <= PAYLOAD_WORDS);
        }
    }

    #[test]
    fn numbers_go_there_and_back() {
        for (number, cause) in (1..).zip(Cause::ALL) {
            assert_eq!((cause.number(), Cause::of(number)), (number, Some(*cause)));
        }
        assert_eq!(Cause::of(0), None);
        assert_eq!(Report::decode([9, 0, 0, 0]), Err(ReportError::Kind(9)));
        assert_eq!(Report::decode([4, 0, 99, 0]), Err(ReportError::Cause(99)));
        let report = Report::decode([5, 7, 11, 3f32.to_bits()]).expect("a report");
        assert_eq!((report.kind, report.sequence, report.joint()), (ReportKind::Stopped, 7, Some(3)));
        let report = Report::decode([1, 7, 0, 3f32.to_bits()]).expect("a report");
        assert_eq!((report.cause, report.joint()), (None, None));
    }
}
