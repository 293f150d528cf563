// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt board hal`: LinuxCNC's HAL file for a system on a board, with the joints, units and addresses that `hal_takt` needs.

use super::Target;
use crate::terminal::files::Out;
use anyhow::{Context, Result, anyhow, bail, ensure};
use clap::Args;
use std::fmt::Write as _;
use std::io::Write;
use takt_board::Wiring;
use takt_board::endpoints::Endpoints;

/// Write LinuxCNC's HAL file for a system of several cores on a board: the component `hal_takt` with the system's addresses, and the nets of
/// its joints (docs/linuxcnc.md).
///
/// The system must have these ports, for joints 1 to N: a FIFO `knots` from the host with the fields `to_1` … `to_N`, `speed_1` … `speed_N`,
/// in this order; inputs `n1` … `nN` from the host for the encoder counts, if the wiring has encoders; and a snapshot `measured` to the host
/// with `m1` … `mN`, `knot`, `phase`, `starved` and `standing`, in this order.
#[derive(Args)]
#[command(after_help = "\
Example:
  takt board hal --wiring lathe_board.toml --program lathe.toml --joints LLR --counts 1e-6,1e-6,2.4e-5 > takt.hal")]
pub(super) struct Hal {
    #[command(flatten)]
    target: Target,
    /// A letter for each joint: L linear, in mm; R rotary, in degrees.
    #[arg(long, value_name = "LETTERS", value_parser = joints)]
    joints: String,
    /// A count of each joint's encoder, in m or rad.
    #[arg(long, value_name = "SIZES", value_delimiter = ',', allow_hyphen_values = true)]
    counts: Vec<f64>,
    /// The way from encoders to joints.
    #[arg(long, value_enum, default_value_t = Geometry::Direct)]
    geometry: Geometry,
    /// Period of LinuxCNC's servo thread, µs, a whole number of the board's periods: the time from knot to knot.
    #[arg(long, value_name = "US", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    servo: u32,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Geometry {
    /// Each joint has its own encoder.
    Direct,
    /// The hybrid robot: the first three joints are the tool's x, y, z, from the lengths of three arms.
    Hybrid,
}

/// Maximum number of joints: a knot must fit into one request.
const MOST: usize = 7;
/// Maximum number of periods between two frames of a stream.
const EVERY: f64 = 4095.0;
/// Values of the snapshot that follow the encoder counts.
const BEHIND: [&str; 4] = ["knot", "phase", "starved", "standing"];

fn joints(text: &str) -> Result<String, String> {
    if (1..=MOST).contains(&text.len()) && text.chars().all(|letter| matches!(letter, 'L' | 'R')) {
        Ok(text.to_owned())
    } else {
        Err(format!("1 to {MOST} letters, L for a linear joint and R for a rotary one"))
    }
}

/// First of the consecutive addresses of these values.
fn block(endpoints: &Endpoints, names: &[String]) -> Result<u16> {
    let find = |name: &String| {
        let place = endpoints.place(name);
        place.map(|place| place.read).with_context(|| format!("the system has no value `{name}` at the host"))
    };
    let places = names.iter().map(find).collect::<Result<Vec<u16>>>()?;
    for (pair, name) in places.windows(2).zip(names) {
        ensure!(pair[1] == pair[0] + 1, "the value that must follow `{name}` at the host is not next to it");
    }
    places.first().copied().context("a joint")
}

/// Parameters of `hal_takt`, derived from system and wiring.
fn addresses(endpoints: &Endpoints, wiring: &Wiring, arguments: &Hal, cores: usize) -> Result<String> {
    let numbered =
        |text: &str| (1..=arguments.joints.len()).map(|joint| format!("{text}{joint}")).collect::<Vec<_>>();
    let encoders = block(endpoints, &numbered("n"))?;
    let behind = BEHIND.iter().map(|name| format!("measured.{name}"));
    let measured = block(endpoints, &numbered("measured.m").into_iter().chain(behind).collect::<Vec<_>>())?;
    let knots = endpoints.fifo("knots", false).map_err(|text| anyhow!(text))?;
    let fields: Vec<&str> = knots.fields.iter().map(|(name, _)| name.as_str()).collect();
    let expected: Vec<String> = [numbered("to_"), numbered("speed_")].concat();
    ensure!(
        fields == expected,
        "the fields of `knots` are {}, not {}",
        fields.join(", "),
        expected.join(", ")
    );
    let period = f64::from(wiring.period) / wiring.clock;
    let every = f64::from(arguments.servo) / period;
    ensure!(
        (every - every.round()).abs() < 1e-6 && (1.0..=EVERY).contains(&every.round()),
        "--servo {}: the servo thread's period is 1 to {EVERY} periods of the board, and one of these takes {period} µs",
        arguments.servo
    );
    Ok(format!(
        "cores={cores} encoders={encoders:#06x} measured={measured:#06x} fifo={:#06x} every={} servo={}",
        knots.field(0),
        every.round(),
        arguments.servo
    ))
}

pub(super) fn run(arguments: &Hal, color: bool, out: &mut Out) -> Result<()> {
    let count = arguments.joints.len();
    if arguments.counts.len() != count {
        bail!("--counts has {} sizes, but --joints has {count} letters", arguments.counts.len());
    }
    if let Some(wrong) = arguments.counts.iter().find(|size| !size.is_finite() || **size == 0.0) {
        bail!("--counts: expected a finite size other than 0 in m or rad, found {wrong}");
    }
    let is_hybrid = matches!(arguments.geometry, Geometry::Hybrid);
    ensure!(
        !is_hybrid || arguments.joints.starts_with("LLL"),
        "--geometry hybrid: the first three joints must be linear"
    );
    let (_, wiring, carried) = arguments.target.read(color, false)?;
    ensure!(wiring.uart, "LinuxCNC is a host at the UART, which the wiring leaves out (`uart = false`)");
    let application = carried.on_board();
    ensure!(
        !application.is_program(),
        "hal_takt drives a system of several cores (docs/linuxcnc.md), but this is a single program"
    );
    let cores = application.description().cores.len();
    let parameters = addresses(application.endpoints(), &wiring, arguments, cores)?;
    out.write_all(text(arguments, &parameters, &wiring).as_bytes())?;
    Ok(())
}

fn text(arguments: &Hal, parameters: &str, wiring: &Wiring) -> String {
    let joints = || 0..arguments.joints.len();
    let counts: Vec<String> = arguments.counts.iter().map(|size| format!("{size:e}")).collect();
    let geometry = match arguments.geometry {
        Geometry::Direct => "direct",
        Geometry::Hybrid => "hybrid",
    };
    let mut text = format!(
        "# LinuxCNC as the planner of a machine whose controller runs on a board of Takt: docs/linuxcnc.md. Written by `takt board hal`.\n\
         # The section [TAKT] of the INI file has PORT, BAUD ({}) and TIMEOUT (ms).\n\n\
         loadrt [KINS]KINEMATICS\n\
         loadrt [EMCMOT]EMCMOT servo_period_nsec=[EMCMOT]SERVO_PERIOD num_joints=[KINS]JOINTS\n\
         loadrt hal_takt port=[TAKT]PORT baud=[TAKT]BAUD timeout=[TAKT]TIMEOUT joints={} counts={} geometry={geometry} {parameters}\n\
         loadrt estop_latch\n\
         loadrt and2 names=drives\n\n\
         # Measured positions come in before motion, the commanded ones go out after it.\n\
         addf takt.read servo-thread\n\
         addf estop-latch.0 servo-thread\n\
         addf motion-command-handler servo-thread\n\
         addf motion-controller servo-thread\n\
         addf drives servo-thread\n\
         addf takt.write servo-thread\n\n\
         # Joints, in mm and degrees.\n",
        wiring.baud,
        arguments.joints,
        counts.join(":"),
    );
    for (net, from, to) in [
        ("cmd", "joint.%.motor-pos-cmd", "takt.%.pos-cmd"),
        ("vel", "joint.%.vel-cmd", "takt.%.vel-cmd"),
        ("fb", "takt.%.pos-fb", "joint.%.motor-pos-fb"),
    ] {
        for joint in joints() {
            let name = |pin: &str| pin.replace('%', &joint.to_string());
            let _ = writeln!(text, "net {net}{joint} {} => {}", name(from), name(to));
        }
    }
    text +=
        "\n# A joint off the point that belongs to its encoder by more than this is a fault (mm, degrees).\n";
    for (joint, letter) in arguments.joints.chars().enumerate() {
        let limit = if letter == 'L' { 0.2 } else { 0.1 };
        let _ = writeln!(text, "setp takt.{joint}.error-limit {limit}");
    }
    let faults: Vec<String> = joints().map(|joint| format!("joint.{joint}.amp-fault-in")).collect();
    text + &format!(
        "\n# Emergency stop: the operator's, or a fault of the board's, stops the outputs in the same servo period.\n\
         net fault takt.fault => estop-latch.0.fault-in {}\n\
         net allowed iocontrol.0.user-enable-out => estop-latch.0.ok-in\n\
         net reset iocontrol.0.user-request-enable => estop-latch.0.reset\n\
         net may-drive estop-latch.0.ok-out => iocontrol.0.emc-enable-in drives.in0\n\
         net amplifier joint.0.amp-enable-out => drives.in1\n\
         net drive drives.out => takt.enable\n\n\
         # There is one tool.\n\
         net prepare iocontrol.0.tool-prepare => iocontrol.0.tool-prepared\n\
         net change iocontrol.0.tool-change => iocontrol.0.tool-changed\n",
        faults.join(" ")
    )
}
