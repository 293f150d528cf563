// SPDX-License-Identifier: MIT OR Apache-2.0
//! Words between host and communication core: packets with a checksum, and reports. One table for each kind of number;
//! `programs/three/packets.s` has the same constants, and a test compares the two.

use std::fmt;

/// Tag of a packet: bits 31 to 24 of its first word.
pub const MAGIC: u32 = 0x54;
/// Words of a packet besides its payload: header, sequence number, checksum.
pub const FRAME_WORDS: usize = 3;
/// Limit on the payload words.
pub const PAYLOAD_WORDS: usize = 12;
/// Bit of [`Motion::flags`]: blend into the next segment without stopping.
pub const FLAG_VIA: u32 = 1;
/// Bit of [`Motion::flags`]: report whether the motion is possible and its duration, without moving.
pub const FLAG_CHECK: u32 = 2;

/// Declares an enumeration whose numbers go over the link.
macro_rules! numbers {
    ($(#[$meta:meta])* $name:ident { $($(#[$row:meta])* $variant:ident = $number:literal, $text:literal;)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum $name { $($(#[$row])* $variant = $number,)* }

        impl $name {
            /// All variants, ascending by number.
            pub const ALL: &[$name] = &[$($name::$variant),*];

            /// Variant of this number; `None` if no variant has it.
            pub fn of(number: u32) -> Option<$name> {
                match number { $($number => Some($name::$variant),)* _ => None }
            }

            /// Number on the link.
            pub const fn number(self) -> u32 {
                self as u32
            }

            /// Description of the variant for messages.
            pub const fn text(self) -> &'static str {
                match self { $($name::$variant => $text,)* }
            }

            /// Identifier of the variant.
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
    /// Kinds of packets, by number.
    Kind {
        /// Sign of life of the host.
        Nop = 0, "no operation";
        /// Motion in joint space.
        Move = 1, "motion in joint space";
        /// Motion along a line in the world.
        MoveL = 2, "motion along a line";
        /// Rates that hold until the next jog.
        Jog = 3, "jog";
        /// Stops along the path, as fast as the limits allow.
        Stop = 4, "stop";
        /// Digital outputs, set when the queue has reached the packet.
        Output = 5, "digital outputs";
        /// Analogue output, set when the queue has reached the packet.
        Level = 6, "analogue output";
        /// Ends the state after an error.
        Reset = 7, "reset";
        /// Tool point in the flange's frame.
        Tool = 8, "tool";
        /// Limits of velocities and torques.
        Limits = 9, "limits";
    }
}

impl Kind {
    /// Number of payload words.
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
        /// Constant acceleration, then constant deceleration.
        Rectangular = 0, "rectangular";
        /// Ramps of constant jerk.
        Trapezoidal = 1, "trapezoidal";
        /// Parabolic acceleration in each half.
        Parabolic = 2, "parabolic";
        /// Cosine acceleration in each half.
        Cosine = 3, "cosine";
    }
}

numbers! {
    /// Meanings of a motion's amount.
    How {
        /// Duration of the motion, s.
        Time = 0, "time";
        /// Speed: of the fastest joint, rad/s; along the line, m/s, or rad/s if it has no length.
        Speed = 1, "speed";
        /// Unused: as fast as the limits allow.
        Fast = 2, "fast";
    }
}

numbers! {
    /// Meanings of a jog's rates.
    JogMode {
        /// Rates of the joints, rad/s.
        Joints = 0, "joints";
        /// Rates of the tool along and about the world's axes, m/s and rad/s.
        World = 1, "world";
        /// Rates of the tool along and about its own axes, m/s and rad/s.
        Gripper = 2, "gripper";
    }
}

numbers! {
    /// Kinds of reports, by number.
    ReportKind {
        /// Taken into the queue; the value is the duration in s.
        Accepted = 1, "accepted";
        /// The motion or command begins.
        Started = 2, "started";
        /// The motion or command has ended.
        Finished = 3, "finished";
        /// The packet is refused.
        Refused = 4, "refused";
        /// The robot has stopped or is stopping, for the given cause.
        Stopped = 5, "stopped";
        /// Ready after power-up or reset.
        Ready = 6, "ready";
        /// Possible; the value is the duration in s.
        Checked = 7, "possible";
    }
}

numbers! {
    /// Causes for which a packet was refused or the robot stopped.
    Cause {
        /// The checksum of a packet is wrong.
        Crc = 1, "a packet's checksum is wrong";
        /// The sequence number does not follow the last one.
        Sequence = 2, "a packet is missing or out of order";
        /// Magic, kind or length: the robot stops. An undefined profile, mode or flag of a motion or a jog: refused.
        Header = 3, "a packet's header, kind or length is wrong";
        /// The remaining words of a packet did not arrive in time.
        Late = 4, "a packet was begun and did not arrive in time";
        /// The host was silent while the robot moved.
        Silent = 5, "the host was silent while the robot moved";
        /// A value in a packet is NaN or infinite.
        NotFinite = 6, "a value is not a finite number";
        /// Joint out of its range; the value is the joint.
        JointLimit = 7, "a joint would leave its range";
        /// The target has no joint angles.
        Unreachable = 8, "the target is out of reach";
        /// The path is at or near a singularity.
        Singular = 9, "the path comes too close to a singularity";
        /// Joint too fast; the value is the joint.
        VelocityLimit = 10, "a joint would be too fast";
        /// Torque too large; the value is the joint.
        TorqueLimit = 11, "a drive would need too much torque";
        /// The queue of segments is full.
        QueueFull = 12, "the queue is full";
        /// The robot stands after an error and takes only a reset.
        StoppedState = 13, "the robot stands after an error: reset it";
        /// Joint off its reference; the value is the joint.
        Tracking = 14, "a joint does not follow its reference";
        /// A `via` motion ended without a successor.
        RanDry = 15, "no motion followed one that was to go on without stopping";
        /// The command needs another state of motion.
        NotWhileMoving = 16, "not while the robot moves";
        /// A core missed its period.
        Deadline = 17, "a core missed its period";
    }
}

impl Cause {
    /// The report's value is the number of a joint, from 1.
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

/// Parameters of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Profile of the acceleration.
    pub profile: Profile,
    /// Meaning of the field `amount`.
    pub how: How,
    /// Duration or speed, by `how`.
    pub amount: f32,
    /// Blends into the next motion.
    pub via: bool,
    /// Checks the motion without executing it.
    pub check: bool,
}

impl Motion {
    /// Word of flags for the packet.
    pub const fn flags(self) -> u32 {
        (if self.via { FLAG_VIA } else { 0 }) | (if self.check { FLAG_CHECK } else { 0 })
    }
}

/// Command of the host. SI units; NaN in a motion's target stands for the present value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Sign of life of the host.
    Nop,
    /// Motion in joint space.
    Move {
        /// Target joint angles, rad.
        joints: [f32; 6],
        /// Parameters of the motion.
        motion: Motion,
    },
    /// Motion along a line to a pose.
    MoveL {
        /// Target pose x, y, z, roll, pitch, yaw, m and rad.
        pose: [f32; 6],
        /// Parameters of the motion.
        motion: Motion,
    },
    /// Rates until the next jog; rates of 0 end it.
    Jog {
        /// Meaning of the field `rates`.
        mode: JogMode,
        /// Six rates: rad/s of the joints; or three in m/s and three in rad/s.
        rates: [f32; 6],
    },
    /// Stops the robot at once.
    Stop,
    /// Sets some of the digital outputs.
    Output {
        /// Outputs to set, as bits.
        mask: u32,
        /// New values of the outputs in `mask`.
        bits: u32,
    },
    /// Sets an analogue output.
    Level {
        /// Channel, 1 or 2.
        channel: u32,
        /// New value of the output.
        value: f32,
    },
    /// Ends the state after an error.
    Reset,
    /// Tool point in the flange's frame, m.
    Tool([f32; 3]),
    /// Limits of the joints.
    Limits {
        /// Limits of the velocities, rad/s.
        velocities: [f32; 6],
        /// Limits of the torques, N·m.
        torques: [f32; 6],
    },
}

impl Command {
    /// Kind of the packet.
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

    /// Words of the packet with this sequence number.
    pub fn encode(&self, sequence: u32) -> Vec<u32> {
        let payload = self.payload();
        let header = MAGIC << 24 | self.kind().number() << 16 | payload.len() as u32;
        let mut words = vec![header, sequence];
        words.extend(payload);
        words.push(checksum(&words));
        words
    }
}

/// CRC-32 (IEEE 802.3, as in zlib) of words, each with its least significant byte first.
pub fn checksum(words: &[u32]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    for word in words {
        hasher.update(&word.to_le_bytes());
    }
    hasher.finalize()
}

/// Answer of the communication core.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// Kind of the answer.
    pub kind: ReportKind,
    /// Sequence number of the answered packet; 0 without one.
    pub sequence: u32,
    /// Cause of a refusal or stop.
    pub cause: Option<Cause>,
    /// Duration in s, or a detail of the cause.
    pub value: f32,
}

/// Reason why words are not a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReportError {
    /// Unknown kind of report.
    #[error("unknown report kind {0}")]
    Kind(u32),
    /// Unknown cause of a report.
    #[error("unknown report cause {0}")]
    Cause(u32),
}

impl Report {
    /// Decodes the fields `report`, `sequence`, `cause`, `value`.
    ///
    /// # Errors
    /// If the kind or the cause is unknown.
    pub fn decode([kind, sequence, cause, value]: [u32; 4]) -> Result<Report, ReportError> {
        let kind = ReportKind::of(kind).ok_or(ReportError::Kind(kind))?;
        let cause = match cause {
            0 => None,
            number => Some(Cause::of(number).ok_or(ReportError::Cause(number))?),
        };
        Ok(Report { kind, sequence, cause, value: f32::from_bits(value) })
    }

    /// Joint named by the value, from 1.
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

    /// Expected checksums are from Python's `zlib.crc32`.
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
    fn numbers_round_trip() {
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
