//! Where the tip is, and how it moves with the joints.

use super::links::Angles;
use super::vector::{Vector, add, constant, turn, weigh};
use crate::graph::{Expr, Graph};
use crate::robot::frames::Link;
use crate::robot::space::{self, Pose};

/// The joints that carry `tip`, from the base.
fn path(links: &[Link], tip: usize) -> Vec<usize> {
    let mut path: Vec<usize> = std::iter::successors(Some(tip), |&joint| links[joint].parent).collect();
    path.reverse();
    path
}

/// A frame's axes in the base's frame, by columns.
type Axes<'g> = [Vector<'g>; 3];

fn columns<'g>(axes: &Axes<'g>, m: &space::M3) -> Axes<'g> {
    std::array::from_fn(|j| {
        std::array::from_fn(|i| weigh(space::column(m, j), [axes[0][i], axes[1][i], axes[2][i]]))
    })
}

fn times<'g>(axes: &Axes<'g>, a: Vector<'g>) -> Vector<'g> {
    std::array::from_fn(|i| a[0] * axes[0][i] + a[1] * axes[1][i] + a[2] * axes[2][i])
}

/// A point of the last link of a path as seen from each joint's origin, and in the base's frame: backwards, by what follows a joint,
/// and by sums of angles what follows the first of those about parallel axes.
fn arms<'g>(
    graph: &'g Graph,
    links: &[Link],
    angles: &Angles<'g>,
    q: &[Expr<'g>],
    path: &[usize],
    point: Vector<'g>,
) -> (Vec<Vector<'g>>, Vector<'g>) {
    let mut arm = vec![constant(graph, [0.0; 3]); path.len()];
    let mut after = point;
    for (place, &index) in path.iter().enumerate().rev() {
        let link = &links[index];
        arm[place] = match angles.sum[index] {
            None => std::array::from_fn(|i| after[i] + link.axis[i] * q[index]),
            Some(angle) => {
                let own = angle.out(after);
                let following = path.get(place + 1).copied();
                match following.filter(|&next| angles.first[next] == angles.first[index]) {
                    Some(_) => add(own, arm[place + 1]),
                    None => own,
                }
            }
        };
        // What the joint before adds to it: the way to this joint's origin, and all behind unless it is added by sums.
        after = match angles.sum[index].is_some() && angles.first[index] != index {
            true => constant(graph, link.origin),
            false => add(constant(graph, link.origin), turn(&link.rest, arm[place])),
        };
    }
    (arm, after)
}

/// What the kinematics of a tip are made of, for each joint on the way to it.
struct Chain<'g> {
    path: Vec<usize>,
    /// The axes of each joint's frame, turned.
    turned: Vec<Axes<'g>>,
    /// The axes that the first of the joints about parallel axes turns in.
    rest: Vec<Axes<'g>>,
    /// The tip as seen from each joint's origin: in the axes of `rest` where the joint turns, of `turned` where it slides.
    arm: Vec<Vector<'g>>,
    /// The same in the base's frame.
    tip: Vector<'g>,
}

impl<'g> Chain<'g> {
    fn new(
        graph: &'g Graph,
        links: &[Link],
        angles: &Angles<'g>,
        q: &[Expr<'g>],
        last: usize,
        pose: &Pose,
    ) -> Chain<'g> {
        let path = path(links, last);
        let base: Axes<'g> = std::array::from_fn(|j| constant(graph, space::column(&space::IDENTITY, j)));
        let mut turned: Vec<Axes<'g>> = Vec::new();
        let mut rest: Vec<Axes<'g>> = Vec::new();
        for (place, &index) in path.iter().enumerate() {
            let link = &links[index];
            let before = if place == 0 { base } else { turned[place - 1] };
            let first = path.iter().position(|&joint| joint == angles.first[index]).unwrap_or(place);
            let still = if first < place { rest[first] } else { columns(&before, &link.rest) };
            rest.push(still);
            turned.push(match angles.sum[index] {
                None => before,
                Some(angle) => {
                    let [x, y, z] = still;
                    let (s, c) = (angle.sin, angle.cos);
                    let name = |a: Vector<'g>, what: &str| -> Vector<'g> {
                        let text = format!("{what} axis of link {}, in the base's frame", index + 1);
                        std::array::from_fn(|i| {
                            a[i].named(format!("{what}{}{}", index + 1, ["x", "y", "z"][i]), &text)
                        })
                    };
                    let across = std::array::from_fn(|i| c * x[i] + s * y[i]);
                    let up = std::array::from_fn(|i| c * y[i] - s * x[i]);
                    [name(across, "x"), name(up, "y"), z]
                }
            });
        }
        let (arm, tip) = arms(graph, links, angles, q, &path, constant(graph, pose.origin));
        Chain { path, turned, rest, arm, tip }
    }
}

/// The tip's rotation by rows, and its position. Positions are computed backwards through the first `split` joints of the way,
/// whose turns are shared by what they carry, and behind them added along the axes, which are there already.
pub(super) fn pose<'g>(
    graph: &'g Graph,
    links: &[Link],
    angles: &Angles<'g>,
    q: &[Expr<'g>],
    tip: usize,
    pose: &Pose,
    split: usize,
) -> ([Vector<'g>; 3], Vector<'g>) {
    let chain = Chain::new(graph, links, angles, q, tip, pose);
    let last = chain.turned[chain.turned.len() - 1];
    let axes = columns(&last, &pose.rotation);
    let rotation = std::array::from_fn(|i| axes.map(|column| column[i]));
    let step = |place: usize| match chain.path.get(place) {
        Some(&index) => constant(graph, links[index].origin),
        None => constant(graph, pose.origin),
    };
    let split = split.min(chain.path.len());
    if split == chain.path.len() {
        return (rotation, chain.tip);
    }
    let (_, mut at) = arms(graph, links, angles, q, &chain.path[..split], step(split));
    for (place, &index) in chain.path.iter().enumerate().skip(split) {
        if angles.own[index].is_none() {
            let axis = constant(graph, links[index].axis).map(|axis| axis * q[index]);
            at = add(at, if place == 0 { axis } else { times(&chain.turned[place - 1], axis) });
        }
        at = add(at, times(&chain.turned[place], step(place + 1)));
    }
    (rotation, at)
}

/// For each joint: the tip's linear and angular velocity for a unit of the joint's; `None` for one that does not carry it.
pub(super) fn jacobian<'g>(
    graph: &'g Graph,
    links: &[Link],
    angles: &Angles<'g>,
    q: &[Expr<'g>],
    tip: usize,
    pose: &Pose,
) -> Vec<Option<(Vector<'g>, Vector<'g>)>> {
    let chain = Chain::new(graph, links, angles, q, tip, pose);
    let mut result = vec![None; links.len()];
    for (place, &index) in chain.path.iter().enumerate() {
        let link = &links[index];
        let signed = |a: Vector<'g>| if link.sign < 0.0 { a.map(|x| -x) } else { a };
        result[index] = Some(match angles.own[index] {
            None => {
                let before = if place == 0 { chain.rest[0] } else { chain.turned[place - 1] };
                (times(&before, constant(graph, link.axis)), constant(graph, [0.0; 3]))
            }
            Some(_) => {
                // z × arm, in the axes that the arm is in.
                let [x, y, _] = chain.arm[place];
                let axes = &chain.rest[place];
                (signed(times(axes, [-y, x, graph.constant(0.0)])), signed(axes[2]))
            }
        });
    }
    result
}
