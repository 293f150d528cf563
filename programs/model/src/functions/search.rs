// SPDX-License-Identifier: MIT OR Apache-2.0
//! From a robot to a function: the equations are written down for several placements of the frames, and the shortest are
//! taken.

use super::kinematics::Third;
use super::links::{Angles, Motion};
use super::{Array, Function, Port, What, inverse, kinematics, mass};
use crate::Error;
use crate::graph::{Delays, Expr, Graph, Id, Rewrites, Unary};
use crate::robot::frames::{self, Layout, Link};
use crate::robot::space::{self, Pose, V3};
use crate::robot::{Kind, Passive, Robot};

/// The options that the equations are made with.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// The rewrites that are allowed.
    pub rewrites: Rewrites,
    /// The latencies that sums are balanced for.
    pub delays: Delays,
    /// The link whose pose is asked for.
    pub tip: Option<&'a str>,
    /// Of computed torque: what an error of position is multiplied by, 1/s².
    pub kp: f64,
    /// And one of velocity, 1/s.
    pub kd: f64,
}

/// More joints take longer to write down, and there are more of them to try: of so many, each is.
const TRIED: usize = 16;

/// One way to write the equations.
#[derive(Clone, PartialEq, Debug)]
struct Attempt {
    layout: Layout,
    /// Use sums of angles of parallel axes.
    sums: bool,
    /// Through how many joints of the way positions are computed backwards; of a Jacobian, from how many joints the ways to the tip are
    /// computed along the base's axes.
    split: usize,
    /// Which row or column of the tip's rotation follows from the others.
    third: Third,
    /// The unit of length, m.
    unit: f64,
}

/// A function of a robot.
///
/// # Errors
/// If there is no one tip where one is needed.
pub fn derive(robot: &Robot, what: What, options: &Options<'_>) -> Result<Function, Error> {
    let tip = match what {
        What::ForwardKinematics | What::Jacobian => Some(tip(robot, options.tip)?),
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
    let split = if what == What::Jacobian { 0 } else { usize::MAX };
    let first = Attempt { layout: Layout::new(robot), sums: true, split, third: Third::Turned, unit: 1.0 };
    let mut search = Search { robot, joints: &joints, cost: &cost, least: cost(&first), best: first };
    search.consider(&|attempt| attempt.sums = false);
    if tip.is_some() {
        // The best at first need not be the best in the end.
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
        && matches!(what, What::InverseDynamics | What::ComputedTorque | What::Gravity | What::MassMatrix)
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

/// A search that changes one choice after the other and keeps what is shorter.
#[derive(Clone)]
struct Search<'a> {
    robot: &'a Robot,
    /// The joints that the function depends on.
    joints: &'a [usize],
    /// Operations, and cycles of the longest chain.
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

    /// Ways to compute where the tip is.
    fn ways(&mut self, what: What) {
        let most = self.joints.len().min(TRIED);
        let thirds = if what == What::ForwardKinematics { &Third::ALL[..] } else { &[Third::Turned] };
        for &third in thirds {
            self.consider(&|attempt| attempt.third = third);
            for split in 0..=most {
                self.consider(&|attempt| (attempt.third, attempt.split) = (third, split));
            }
        }
    }

    /// Placements of the frames.
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

/// Lengths that would be worth being 1.
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

/// The link whose pose is asked for, the joint that carries it, and its place there.
type Tip<'a> = (&'a str, usize, Pose);

fn tip<'a>(robot: &'a Robot, name: Option<&str>) -> Result<Tip<'a>, Error> {
    let frame = match name {
        Some(name) => robot.frame(name),
        // The last link of the one branch there is.
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

/// The names of the joints in names of ports.
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

/// The inputs, in the order in which they were asked for.
struct Inputs<'g> {
    graph: &'g Graph,
    ports: Vec<Port>,
    arrays: Vec<Array>,
}

/// The outputs and the arrays that they are.
struct Outputs {
    ports: Vec<(Port, Id)>,
    arrays: Vec<Array>,
}

impl Outputs {
    /// Those that are one array.
    fn array(name: &str, shape: &[usize], ports: Vec<(Port, Id)>) -> Outputs {
        Outputs { arrays: vec![Array::new(name, 0, shape)], ports }
    }
}

impl<'g> Inputs<'g> {
    /// One for each joint.
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
            self.ports.push(Port { name: format!("{what}_{name}"), text });
        }
        inputs
    }
}

fn write(
    robot: &Robot,
    what: What,
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
    Function { title: String::new(), notes: Vec::new(), inputs, outputs, input_arrays, output_arrays, graph }
}

fn equations(
    inputs: &mut Inputs<'_>,
    robot: &Robot,
    what: What,
    options: &Options<'_>,
    tip: Option<Tip<'_>>,
    attempt: &Attempt,
) -> Outputs {
    let graph = inputs.graph;
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
            (Port { name: format!("{what}_{name}"), text }, value.id())
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
    // With the forces that act in the joints by themselves; friction is against the velocity `slip`.
    let forces = |qd: &[Expr<'_>], qdd: &[Expr<'_>], slip: &[Expr<'_>]| {
        let ids = inverse(&links, qd, qdd);
        let moving = |i: usize| [q[i].id(), qd[i].id(), qdd[i].id(), slip[i].id()].map(|id| graph.expr(id));
        let all = robot.joints.iter().zip(exprs(ids)).enumerate();
        all.map(|(i, (joint, tau))| resisted(tau, &joint.passive, moving(i))).collect::<Vec<_>>()
    };
    match what {
        What::InverseDynamics => {
            let qd = inputs.joints(robot, "qd", "velocity", &speed);
            let qdd = inputs.joints(robot, "qdd", "acceleration", &rate);
            outputs("tau", "force", &force, forces(&qd, &qdd, &qd))
        }
        What::Gravity => outputs("tau", "force", &force, forces(&zero, &zero, &zero)),
        What::ComputedTorque => {
            let qd = inputs.joints(robot, "qd", "velocity", &speed);
            let qr = inputs.joints(robot, "qr", "reference position", &position);
            let qdr = inputs.joints(robot, "qdr", "reference velocity", &speed);
            let qddr = inputs.joints(robot, "qddr", "reference acceleration", &rate);
            let wanted: Vec<Expr<'_>> = (0..count)
                .map(|i| qddr[i] + options.kp * (qr[i] - q[i]) + options.kd * (qdr[i] - qd[i]))
                .collect();
            // The measured velocity's sign would change with its noise.
            outputs("tau", "force", &force, forces(&qd, &wanted, &qdr))
        }
        What::MassMatrix => {
            let angles = Angles::new(graph, &links, &q, attempt.sums);
            let matrix = with_rotors(robot, mass::matrix(graph, &links, &angles, &q));
            let mut ports = Vec::new();
            let mut elements = vec![None; count * count];
            for (row, entries) in matrix.iter().enumerate() {
                for (column, entry) in entries.iter().enumerate() {
                    let text = format!("inertia of {} and {}", links[row].name, links[column].name);
                    let port = Port { name: format!("M_{}_{}", row + 1, column + 1), text };
                    elements[row * count + column] = Some(ports.len());
                    elements[column * count + row] = Some(ports.len());
                    ports.push((port, entry.unwrap_or_else(|| graph.constant(0.0)).id()));
                }
            }
            Outputs { ports, arrays: vec![Array { elements, ..Array::new("M", 0, &[count, count]) }] }
        }
        What::ForwardDynamics => {
            let qd = inputs.joints(robot, "qd", "velocity", &speed);
            let tau = inputs.joints(robot, "tau", "force", &force);
            let bias = forces(&qd, &zero, &qd);
            let angles = Angles::new(graph, &links, &q, attempt.sums);
            let matrix = with_rotors(robot, mass::matrix(graph, &links, &angles, &q));
            let forces = tau.iter().zip(&bias).map(|(tau, bias)| *tau - *bias).collect();
            outputs("qdd", "acceleration", &rate, mass::solve(&links, matrix, forces))
        }
        What::ForwardKinematics | What::Jacobian => {
            let Some((_, joint, pose)) = tip else {
                return Outputs { ports: Vec::new(), arrays: Vec::new() };
            };
            let pose = aligned(&mut links, joint, &pose);
            let angles = Angles::new(graph, &links, &q, attempt.sums);
            if what == What::Jacobian {
                let columns = kinematics::jacobian(graph, &links, &angles, &q, joint, &pose, attempt.split);
                return Outputs::array("J", &[6, count], jacobian_ports(graph, robot, &columns));
            }
            let (rotation, position) =
                kinematics::pose(graph, &links, &angles, &q, joint, &pose, (attempt.split, attempt.third));
            let mut ports = Vec::new();
            for (i, row) in rotation.iter().enumerate() {
                for (j, entry) in row.iter().enumerate() {
                    let text = format!("rotation, row {}, column {}", i + 1, j + 1);
                    ports.push((Port { name: format!("R_{}_{}", i + 1, j + 1), text }, entry.id()));
                }
            }
            for (axis, entry) in ["x", "y", "z"].iter().zip(position) {
                let port = Port { name: format!("p_{axis}"), text: format!("position along {axis}, m") };
                ports.push((port, entry.id()));
            }
            Outputs { ports, arrays: vec![Array::new("R", 0, &[3, 3]), Array::new("p", 9, &[3])] }
        }
    }
}

/// A joint's force with what its rotor, its friction and its spring take, of a motion of which the position, the velocity, the
/// acceleration and the velocity that friction is against are given.
fn resisted<'g>(force: Expr<'g>, passive: &Passive, [q, qd, qdd, slip]: [Expr<'g>; 4]) -> Expr<'g> {
    let &Passive { armature, damping, friction, stiffness, rest } = passive;
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

/// The joint-space inertia with that of the rotors.
fn with_rotors<'g>(robot: &Robot, mut matrix: mass::Matrix<'g>) -> mass::Matrix<'g> {
    for (index, joint) in robot.joints.iter().enumerate() {
        if let Some(entry) = matrix[index][index].filter(|_| joint.passive.armature != 0.0) {
            matrix[index][index] = Some(entry + entry.graph().constant(joint.passive.armature));
        }
    }
    matrix
}

/// The tip in the frame of the joint that carries it. A part of its rotation that is about the joint's axis becomes a part of the
/// joint's, where what remains is quarter turns.
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
            ports.push((Port { name: format!("J_{}_{}", row + 1, column + 1), text }, entry.id()));
        }
    }
    ports
}
