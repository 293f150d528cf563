// SPDX-License-Identifier: MIT OR Apache-2.0
//! Derivation of a robot's function: writes the equations for several placements of the frames and takes the shortest.

use super::kinematics::Third;
use super::links::{Angles, Motion};
use super::{RobotFunction, inverse, kinematics, mass};
use crate::Error;
use crate::graph::{Array, Delays, Expr, Function, Graph, Id, Port, Rewrites, Unary};
use crate::robot::frames::{self, Layout, Link};
use crate::robot::space::{self, Pose, V3};
use crate::robot::{Kind, PassiveForces, Robot};

/// Options of the derivation.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Rewrites that may be applied.
    pub rewrites: Rewrites,
    /// Latencies for which sums are balanced.
    pub delays: Delays,
    /// Link whose pose or velocity is computed.
    pub tip: Option<&'a str>,
    /// Position gain of computed torque, 1/s².
    pub kp: f64,
    /// Velocity gain of computed torque, 1/s.
    pub kd: f64,
}

/// Limit on the joints, quarter-turn variants and units that the search tries; robots with more joints are compared before optimisation,
/// to save time.
const TRIED: usize = 16;

/// A variant of the equations.
#[derive(Clone, PartialEq, Debug)]
struct Attempt {
    layout: Layout,
    /// Add up angles of parallel axes.
    sums: bool,
    /// Number of joints through which the tip's position is computed backwards; of a Jacobian, the number of joints whose vectors to the
    /// tip are computed along the base's axes.
    split: usize,
    /// Method of computing the tip's rotation.
    third: Third,
    /// Unit of length, m.
    unit: f64,
}

/// Derives a function of a robot.
///
/// # Errors
/// If the tip is needed and ambiguous, unknown or fixed.
pub fn derive(robot: &Robot, what: RobotFunction, options: &Options<'_>) -> Result<Function, Error> {
    let tip = match what {
        RobotFunction::ForwardKinematics | RobotFunction::Jacobian => Some(tip(robot, options.tip)?),
        _ => None,
    };
    let joints: Vec<usize> = match tip {
        Some((_, last, _)) => kinematics::path(&frames::place(robot, &Layout::new(robot)), last),
        None => (0..robot.joints.len()).collect(),
    };
    let cost = |attempt: &Attempt| {
        let mut function = write(robot, what, options, tip, attempt);
        if joints.len() <= TRIED {
            function = function.improved(&options.delays, false);
        }
        (function.count().total(), function.depth(&options.delays))
    };
    let split = if what == RobotFunction::Jacobian { 0 } else { usize::MAX };
    let first = Attempt { layout: Layout::new(robot), sums: true, split, third: Third::Turned, unit: 1.0 };
    let mut search = Search { robot, joints: &joints, cost: &cost, least: cost(&first), best: first };
    search.consider(&|attempt| attempt.sums = false);
    if tip.is_some() {
        // Alternate both orders, because the greedy first choice need not be the best in the end.
        let mut other = search.clone();
        other.ways(what);
        other.layouts();
        search.layouts();
        search.ways(what);
        if other.least < search.least {
            search = other;
        }
        search.ways(what);
    }
    search.layouts();
    while tip.is_some() {
        let before = search.least;
        search.ways(what);
        search.layouts();
        if search.least == before {
            break;
        }
    }
    let scales = options.rewrites.scale
        && matches!(
            what,
            RobotFunction::InverseDynamics
                | RobotFunction::ComputedTorque
                | RobotFunction::Gravity
                | RobotFunction::MassMatrix
        )
        && robot.joints.iter().all(|joint| joint.kind == Kind::Revolute);
    if scales {
        for unit in units(&frames::place(robot, &search.best.layout)).into_iter().take(TRIED) {
            search.consider(&|attempt| attempt.unit = unit);
        }
    }
    let best = search.best;
    let mut function = write(robot, what, options, tip, &best).optimised(&options.delays);
    function.title = match tip {
        Some((name, ..)) => format!("{} of {}, tip {name}: {}", what.name(), robot.name, what.text()),
        None => format!("{} of {}: {}", what.name(), robot.name, what.text()),
    };
    function.notes = notes(robot, &best);
    Ok(function)
}

/// Coordinate search over variants: changes a choice at a time and keeps the cheaper variant.
#[derive(Clone)]
struct Search<'a> {
    robot: &'a Robot,
    /// Joints on which the function depends.
    joints: &'a [usize],
    /// Cost of a variant: operations, then cycles of the critical path.
    cost: &'a dyn Fn(&Attempt) -> (usize, u32),
    best: Attempt,
    least: (usize, u32),
}

impl Search<'_> {
    fn consider(&mut self, change: &dyn Fn(&mut Attempt)) {
        let mut other = self.best.clone();
        change(&mut other);
        let cost = if other == self.best { self.least } else { (self.cost)(&other) };
        if cost < self.least {
            (self.best, self.least) = (other, cost);
        }
    }

    /// Tries methods of computing the tip's pose.
    fn ways(&mut self, what: RobotFunction) {
        let most = self.joints.len().min(TRIED);
        let thirds =
            if what == RobotFunction::ForwardKinematics { &Third::ALL[..] } else { &[Third::Turned] };
        for &third in thirds {
            self.consider(&|attempt| attempt.third = third);
            for split in 0..=most {
                self.consider(&|attempt| (attempt.third, attempt.split) = (third, split));
            }
        }
    }

    /// Tries placements of the frames.
    fn layouts(&mut self) {
        let joints = self.joints;
        for &joint in joints.iter().take(TRIED) {
            self.consider(&|attempt| attempt.layout.incoming[joint] ^= true);
        }
        for joint in self.robot.leaves().into_iter().take(TRIED) {
            self.consider(&|attempt| attempt.layout.balanced[joint] ^= true);
        }
        for &joint in joints.iter().take(TRIED) {
            for quarters in 0..4 {
                self.consider(&|attempt| attempt.layout.quarters[joint] = quarters);
            }
            for quarters in 0..4 {
                self.consider(&|attempt| {
                    attempt.layout.flipped[joint] ^= true;
                    attempt.layout.quarters[joint] = quarters;
                });
            }
        }
        self.consider(&|attempt| attempt.sums ^= true);
    }
}

/// Candidate units of length: each makes a length or a moment 1.
fn units(links: &[Link]) -> Vec<f64> {
    let mut units: Vec<f64> = Vec::new();
    for link in links {
        let lengths = link.origin.into_iter().chain(link.body.first.map(|first| 1.0 / first));
        for length in lengths.map(f64::abs).filter(|length| length.is_normal()) {
            if !units.contains(&length) {
                units.push(length);
            }
        }
    }
    units
}

/// Link whose pose is computed, the joint that carries it, and its pose in that joint's body.
type Tip<'a> = (&'a str, usize, Pose);

fn tip<'a>(robot: &'a Robot, name: Option<&str>) -> Result<Tip<'a>, Error> {
    let frame = match name {
        Some(name) => robot.frame(name),
        // Last link of the only branch.
        None => match robot.leaves()[..] {
            [leaf] => robot.frames.iter().rev().find(|frame| frame.joint == Some(leaf)),
            _ => None,
        },
    };
    let frame = frame.ok_or_else(|| {
        let leaves = robot.leaves();
        let names: Vec<&str> = robot
            .frames
            .iter()
            .filter(|frame| frame.joint.is_some_and(|joint| leaves.contains(&joint)))
            .map(|frame| frame.name.as_str())
            .collect();
        let ends = crate::robot::list(&names);
        Error::plain(format!("the robot has several ends: choose a link with --tip, among them {ends}"))
    })?;
    let joint =
        frame.joint.ok_or_else(|| Error::plain(format!("--tip: link `{}` does not move", frame.name)))?;
    Ok((&frame.name, joint, frame.pose))
}

fn notes(robot: &Robot, attempt: &Attempt) -> Vec<String> {
    let mut notes = robot.notes.clone();
    let links = frames::place(robot, &attempt.layout);
    notes.push("frames: z along the joint's axis; of each link: its joint, and where its frame lies in the one before".to_owned());
    for (index, link) in links.iter().enumerate() {
        let before = link.parent.map_or_else(|| robot.base.clone(), |parent| format!("link {}", parent + 1));
        let vector = |a: V3| a.map(|x| format!("{}", (x * 1e6).round() / 1e6 + 0.0)).join(" ");
        notes.push(format!(
            "link {}: {}, on {before}: origin {} m, axis {}",
            index + 1,
            link.name,
            vector(link.origin),
            vector(link.axis)
        ));
    }
    if attempt.unit != 1.0 {
        notes.push(format!("unit of length: {:.6} m", attempt.unit));
    }
    notes
}

/// Port-name stems of the joints.
pub(super) fn port_names(robot: &Robot) -> Vec<String> {
    let plain = |name: &str| -> String {
        let name = name.strip_suffix("_joint").unwrap_or(name);
        name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' }).collect()
    };
    let names: Vec<String> = robot.joints.iter().map(|joint| plain(&joint.name)).collect();
    let unique = |name: &String| names.iter().filter(|other| *other == name).count() == 1;
    names
        .iter()
        .enumerate()
        .map(|(index, name)| if unique(name) { name.clone() } else { format!("{name}_{}", index + 1) })
        .collect()
}

/// Inputs in order of first use.
struct Inputs<'g> {
    graph: &'g Graph,
    ports: Vec<Port>,
    arrays: Vec<Array>,
}

/// Outputs and their grouping into arrays.
struct Outputs {
    ports: Vec<(Port, Id)>,
    arrays: Vec<Array>,
}

impl Outputs {
    /// Outputs that form one array.
    fn array(name: &str, shape: &[usize], ports: Vec<(Port, Id)>) -> Outputs {
        Outputs { arrays: vec![Array::new(name, 0, shape)], ports }
    }
}

impl<'g> Inputs<'g> {
    /// Adds an input for each joint.
    fn joints(
        &mut self,
        robot: &Robot,
        what: &str,
        text: &str,
        unit: &dyn Fn(Kind) -> String,
    ) -> Vec<Expr<'g>> {
        let names = port_names(robot);
        self.arrays.push(Array::new(what, self.ports.len(), &[robot.joints.len()]));
        let mut inputs = Vec::new();
        for (joint, name) in robot.joints.iter().zip(names) {
            inputs.push(self.graph.input(self.ports.len()));
            let text = format!("{text} of {}, {}", joint.name, unit(joint.kind));
            self.ports.push(Port::new(format!("{what}_{name}"), text));
        }
        inputs
    }
}

fn write(
    robot: &Robot,
    what: RobotFunction,
    options: &Options<'_>,
    tip: Option<Tip<'_>>,
    attempt: &Attempt,
) -> Function {
    let graph = Graph::new(options.rewrites);
    let (inputs, input_arrays, outputs) = {
        let mut inputs = Inputs { graph: &graph, ports: Vec::new(), arrays: Vec::new() };
        let outputs = equations(&mut inputs, robot, what, options, tip, attempt);
        (inputs.ports, inputs.arrays, outputs)
    };
    let Outputs { ports: outputs, arrays: output_arrays } = outputs;
    Function { input_arrays, output_arrays, ..Function::new(graph, inputs, outputs) }
}

/// Links in the units of an attempt, and gravity.
fn scaled_links(robot: &Robot, attempt: &Attempt) -> (Vec<Link>, [f64; 3]) {
    let mut links = frames::place(robot, &attempt.layout);
    let mut gravity = robot.gravity;
    if attempt.unit != 1.0 {
        let unit = attempt.unit;
        gravity = space::scale(1.0 / unit, gravity);
        for link in &mut links {
            link.origin = link.origin.map(|x| if x.abs() == unit { x.signum() } else { x / unit });
            link.body.first =
                link.body.first.map(|x| if (x * unit).abs() - 1.0 == 0.0 { x.signum() } else { x * unit });
            link.body.mass *= unit * unit;
        }
    }
    (links, gravity)
}

fn equations(
    inputs: &mut Inputs<'_>,
    robot: &Robot,
    what: RobotFunction,
    options: &Options<'_>,
    tip: Option<Tip<'_>>,
    attempt: &Attempt,
) -> Outputs {
    let graph = inputs.graph;
    let (mut links, gravity) = scaled_links(robot, attempt);
    let count = links.len();
    let zero = vec![graph.constant(0.0); count];
    let position = |kind: Kind| kind.unit().to_owned();
    let speed = |kind: Kind| format!("{}/s", kind.unit());
    let rate = |kind: Kind| format!("{}/s²", kind.unit());
    let force = |kind: Kind| kind.force().to_owned();
    let names = port_names(robot);
    let q = inputs.joints(robot, "q", "position", &position);
    let outputs = |what: &str, text: &str, unit: &dyn Fn(Kind) -> String, values: Vec<Expr<'_>>| {
        let ports = robot.joints.iter().zip(&names).zip(values);
        let ports = ports.map(|((joint, name), value)| {
            let text = format!("{text} of {}, {}", joint.name, unit(joint.kind));
            (Port::new(format!("{what}_{name}"), text), value.id())
        });
        Outputs::array(what, &[count], ports.collect())
    };
    let inverse = |links: &[Link], qd: &[Expr<'_>], qdd: &[Expr<'_>]| -> Vec<Id> {
        let again = |list: &[Expr<'_>], i: usize| graph.expr(list[i].id());
        let motions: Vec<Motion<'_>> = (0..count)
            .map(|i| Motion { q: graph.expr(q[i].id()), qd: again(qd, i), qdd: again(qdd, i) })
            .collect();
        let angles = Angles::new(graph, links, &q, attempt.sums);
        inverse::forces(graph, links, gravity, &angles, &motions).iter().map(|tau| tau.id()).collect()
    };
    let exprs = |ids: Vec<Id>| ids.into_iter().map(|id| graph.expr(id)).collect::<Vec<_>>();
    // Adds the joints' passive forces; friction opposes the velocity `slip`.
    let forces = |qd: &[Expr<'_>], qdd: &[Expr<'_>], slip: &[Expr<'_>]| {
        let ids = inverse(&links, qd, qdd);
        let moving = |i: usize| [q[i].id(), qd[i].id(), qdd[i].id(), slip[i].id()].map(|id| graph.expr(id));
        let all = robot.joints.iter().zip(exprs(ids)).enumerate();
        all.map(|(i, (joint, tau))| resisted(tau, &joint.passive, moving(i))).collect::<Vec<_>>()
    };
    match what {
        RobotFunction::InverseDynamics => {
            let qd = inputs.joints(robot, "qd", "velocity", &speed);
            let qdd = inputs.joints(robot, "qdd", "acceleration", &rate);
            outputs("tau", "force", &force, forces(&qd, &qdd, &qd))
        }
        RobotFunction::Gravity => outputs("tau", "force", &force, forces(&zero, &zero, &zero)),
        RobotFunction::ComputedTorque => {
            let qd = inputs.joints(robot, "qd", "velocity", &speed);
            let qr = inputs.joints(robot, "qr", "reference position", &position);
            let qdr = inputs.joints(robot, "qdr", "reference velocity", &speed);
            let qddr = inputs.joints(robot, "qddr", "reference acceleration", &rate);
            let wanted: Vec<Expr<'_>> = (0..count)
                .map(|i| qddr[i] + options.kp * (qr[i] - q[i]) + options.kd * (qdr[i] - qd[i]))
                .collect();
            // The sign of the measured velocity would flicker with its noise.
            outputs("tau", "force", &force, forces(&qd, &wanted, &qdr))
        }
        RobotFunction::MassMatrix => {
            let angles = Angles::new(graph, &links, &q, attempt.sums);
            let matrix = with_rotors(robot, mass::matrix(graph, &links, &angles, &q));
            mass_ports(graph, &links, &matrix)
        }
        RobotFunction::ForwardDynamics => {
            let qd = inputs.joints(robot, "qd", "velocity", &speed);
            let tau = inputs.joints(robot, "tau", "force", &force);
            let bias = forces(&qd, &zero, &qd);
            let angles = Angles::new(graph, &links, &q, attempt.sums);
            let matrix = with_rotors(robot, mass::matrix(graph, &links, &angles, &q));
            let forces = tau.iter().zip(&bias).map(|(tau, bias)| *tau - *bias).collect();
            outputs("qdd", "acceleration", &rate, mass::solve(&links, matrix, forces))
        }
        RobotFunction::ForwardKinematics | RobotFunction::Jacobian => {
            let Some((_, joint, pose)) = tip else {
                return Outputs { ports: Vec::new(), arrays: Vec::new() };
            };
            let pose = aligned(&mut links, joint, &pose);
            let angles = Angles::new(graph, &links, &q, attempt.sums);
            if what == RobotFunction::Jacobian {
                let columns = kinematics::jacobian(graph, &links, &angles, &q, joint, &pose, attempt.split);
                return Outputs::array("J", &[6, count], jacobian_ports(graph, robot, &columns));
            }
            let (rotation, position) =
                kinematics::pose(graph, &links, &angles, &q, joint, &pose, (attempt.split, attempt.third));
            pose_ports(&rotation, &position)
        }
    }
}

/// Ports of the entries of the joint-space inertia.
fn mass_ports(graph: &Graph, links: &[Link], matrix: &mass::Matrix<'_>) -> Outputs {
    let count = links.len();
    let mut ports = Vec::new();
    let mut elements = vec![None; count * count];
    for (row, entries) in matrix.iter().enumerate() {
        for (column, entry) in entries.iter().enumerate() {
            let text = format!("inertia of {} and {}", links[row].name, links[column].name);
            let port = Port::new(format!("M_{}_{}", row + 1, column + 1), text);
            elements[row * count + column] = Some(ports.len());
            elements[column * count + row] = Some(ports.len());
            ports.push((port, entry.unwrap_or_else(|| graph.constant(0.0)).id()));
        }
    }
    Outputs { ports, arrays: vec![Array { elements, ..Array::new("M", 0, &[count, count]) }] }
}

/// Ports of a pose: rotation and position.
fn pose_ports(rotation: &[[Expr<'_>; 3]; 3], position: &[Expr<'_>; 3]) -> Outputs {
    let mut ports = Vec::new();
    for (i, row) in rotation.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            let text = format!("rotation, row {}, column {}", i + 1, j + 1);
            ports.push((Port::new(format!("R_{}_{}", i + 1, j + 1), text), entry.id()));
        }
    }
    for (axis, entry) in ["x", "y", "z"].iter().zip(position) {
        let port = Port::new(format!("p_{axis}"), format!("position along {axis}, m"));
        ports.push((port, entry.id()));
    }
    Outputs { ports, arrays: vec![Array::new("R", 0, &[3, 3]), Array::new("p", 9, &[3])] }
}

/// Adds the forces of rotor, friction and spring to a joint's force, given position, velocity, acceleration, and the velocity that friction
/// opposes.
fn resisted<'g>(force: Expr<'g>, passive: &PassiveForces, [q, qd, qdd, slip]: [Expr<'g>; 4]) -> Expr<'g> {
    let &PassiveForces { armature, damping, friction, stiffness, rest } = passive;
    let graph = q.graph();
    let mut sum = force;
    let mut add = |factor: f64, of: &dyn Fn() -> Expr<'g>| {
        if factor != 0.0 {
            sum = sum + factor * of();
        }
    };
    add(armature, &|| qdd);
    add(damping, &|| qd);
    add(friction, &|| slip.unary(Unary::Sign));
    add(stiffness, &|| q - graph.constant(rest));
    sum
}

/// Adds the rotors' inertia to the diagonal of the joint-space inertia.
fn with_rotors<'g>(robot: &Robot, mut matrix: mass::Matrix<'g>) -> mass::Matrix<'g> {
    for (index, joint) in robot.joints.iter().enumerate() {
        if let Some(entry) = matrix[index][index].filter(|_| joint.passive.armature != 0.0) {
            matrix[index][index] = Some(entry + entry.graph().constant(joint.passive.armature));
        }
    }
    matrix
}

/// Pose of the tip in the frame of its joint. If the tip's rotation about the joint's axis is not a multiple of a quarter turn, the
/// joint's offset absorbs it.
fn aligned(links: &mut [Link], joint: usize, pose: &Pose) -> Pose {
    let tip = links[joint].own.then(pose);
    let tip =
        Pose { rotation: space::cleaned(&tip.rotation), origin: space::cleaned_vector(tip.origin, 1.0) };
    let across = (0..3).find(|&j| tip.rotation[2][j].abs() == 1.0).map(|j| (j + 1) % 3);
    let Some(column) = across.filter(|_| links[joint].kind == Kind::Revolute) else { return tip };
    let [x, y, _] = space::column(&tip.rotation, column);
    let angle = y.atan2(x);
    if space::quarters(angle).is_some() {
        return tip;
    }
    links[joint].offset += angle;
    let back = Pose { rotation: space::about(2, -angle), origin: [0.0; 3] };
    let tip = back.then(&tip);
    Pose { rotation: space::cleaned(&tip.rotation), origin: space::cleaned_vector(tip.origin, 1.0) }
}

fn jacobian_ports<'g>(
    graph: &'g Graph,
    robot: &Robot,
    columns: &[Option<(super::vector::Vector<'g>, super::vector::Vector<'g>)>],
) -> Vec<(Port, Id)> {
    let nothing = graph.constant(0.0);
    let mut ports = Vec::new();
    for row in 0..6 {
        for (column, entries) in columns.iter().enumerate() {
            let entry = match entries {
                Some((linear, angular)) => {
                    if row < 3 {
                        linear[row]
                    } else {
                        angular[row - 3]
                    }
                }
                None => nothing,
            };
            let axis = ["x", "y", "z"][row % 3];
            let unit = if row < 3 { "velocity" } else { "angular velocity" };
            let text =
                format!("{unit} of the tip along {axis} per velocity of {}", robot.joints[column].name);
            ports.push((Port::new(format!("J_{}_{}", row + 1, column + 1), text), entry.id()));
        }
    }
    ports
}
