// SPDX-License-Identifier: MIT OR Apache-2.0
//! Kinematics of the tip: its pose, and its Jacobian.

use super::links::Angles;
use super::vector::{Vector, add, constant, cross, turn, weigh};
use crate::graph::{Expr, Graph};
use crate::robot::Kind;
use crate::robot::frames::Link;
use crate::robot::space::{self, Pose};

/// The joints that carry `tip`, from the base.
pub(super) fn path(links: &[Link], tip: usize) -> Vec<usize> {
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
        // The part that the joint before adds to it: the way to this joint's origin, and all behind unless it is added by sums.
        after = match angles.sum[index].is_some() && angles.first[index] != index {
            true => constant(graph, link.origin),
            false => add(constant(graph, link.origin), turn(&link.rest, arm[place])),
        };
    }
    (arm, after)
}

/// The parts of a tip's kinematics, for each joint on the way to it.
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

    /// From the origins of the first `split` joints to the tip, in the base's frame.
    fn ways(
        &self,
        graph: &'g Graph,
        links: &[Link],
        q: &[Expr<'g>],
        pose: &Pose,
        split: usize,
    ) -> Vec<Vector<'g>> {
        let split = split.min(self.path.len());
        let mut way = match self.arm.get(split) {
            Some(arm) => times(&self.rest[split], *arm),
            None => constant(graph, [0.0; 3]),
        };
        let mut ways = Vec::with_capacity(split);
        for place in (0..split).rev() {
            let step = self.path.get(place + 1).map_or(pose.origin, |&next| links[next].origin);
            way = add(way, times(&self.turned[place], constant(graph, step)));
            ways.push(way);
            let link = &links[self.path[place]];
            if link.kind == Kind::Prismatic {
                let slid = constant(graph, link.axis).map(|axis| axis * q[self.path[place]]);
                way = add(way, times(&self.rest[place], slid));
            }
        }
        ways.reverse();
        ways
    }
}

/// The way in which the nine entries of a rotation are computed. Of three perpendicular rows, or columns, two give the third, by nine products and
/// differences; and two rows, or columns, are turned by two thirds of what it takes to turn all.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Third {
    /// All by turning.
    Turned,
    /// This row is the product of the other two, which are turned from the base on.
    Row(usize),
    /// This column is the product of the other two, which are turned from the tip on.
    Column(usize),
}

impl Third {
    /// All there are.
    pub(super) const ALL: [Third; 7] = [
        Third::Turned,
        Third::Row(0),
        Third::Row(1),
        Third::Row(2),
        Third::Column(0),
        Third::Column(1),
        Third::Column(2),
    ];
}

/// Three perpendicular vectors, the one at `third` as the product of the others.
fn completed<'g>(mut axes: Axes<'g>, third: usize) -> Axes<'g> {
    axes[third] = cross(axes[(third + 1) % 3], axes[(third + 2) % 3]);
    axes
}

fn transposed<'g>(axes: &Axes<'g>) -> Axes<'g> {
    std::array::from_fn(|i| std::array::from_fn(|j| axes[j][i]))
}

/// A direction of the last link of a path, in the base's frame: backwards, about parallel axes at once.
fn direction<'g>(links: &[Link], angles: &Angles<'g>, path: &[usize], mut a: Vector<'g>) -> Vector<'g> {
    for (place, &index) in path.iter().enumerate().rev() {
        let following = path.get(place + 1).copied();
        let turned = following.is_some_and(|next| angles.first[next] == angles.first[index]);
        if let Some(angle) = angles.sum[index].filter(|_| !turned) {
            a = angle.out(a);
        }
        if angles.first[index] == index {
            a = turn(&links[index].rest, a);
        }
    }
    a
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
    (split, third): (usize, Third),
) -> ([Vector<'g>; 3], Vector<'g>) {
    let chain = Chain::new(graph, links, angles, q, tip, pose);
    let last = chain.turned[chain.turned.len() - 1];
    let axes = columns(&last, &pose.rotation);
    let axes = match third {
        Third::Turned => axes,
        Third::Row(third) => transposed(&completed(transposed(&axes), third)),
        Third::Column(third) => {
            let column =
                |j| direction(links, angles, &chain.path, constant(graph, space::column(&pose.rotation, j)));
            completed(std::array::from_fn(column), third)
        }
    };
    let rotation = transposed(&axes);
    let split = split.min(chain.path.len());
    if split == chain.path.len() {
        return (rotation, chain.tip);
    }
    let step = |place: usize| match chain.path.get(place) {
        Some(&index) => constant(graph, links[index].origin),
        None => constant(graph, pose.origin),
    };
    let (_, mut at) = arms(graph, links, angles, q, &chain.path[..split], step(split));
    for (place, &index) in chain.path.iter().enumerate().skip(split) {
        if angles.own[index].is_none() {
            let axis = constant(graph, links[index].axis).map(|axis| axis * q[index]);
            at = add(at, if place == 0 { axis } else { times(&chain.turned[place - 1], axis) });
        }
        let ahead = match chain.path.get(place + 1) {
            Some(_) => times(&chain.turned[place], step(place + 1)),
            // Along the tip's own axes, which are outputs.
            None => times(&axes, constant(graph, turned_back(&pose.rotation, pose.origin))),
        };
        at = add(at, ahead);
    }
    (rotation, at)
}

/// A vector in the axes of a rotation.
fn turned_back(rotation: &space::M3, a: space::V3) -> space::V3 {
    space::cleaned_vector(space::turn(&space::transpose(rotation), a), 1.0)
}

/// For each joint: the tip's linear and angular velocity for a unit of the joint's; `None` for one that does not carry it. The way
/// from a joint to the tip is computed backwards in the joints' frames, but from the first `split` joints along the base's axes.
pub(super) fn jacobian<'g>(
    graph: &'g Graph,
    links: &[Link],
    angles: &Angles<'g>,
    q: &[Expr<'g>],
    tip: usize,
    pose: &Pose,
    split: usize,
) -> Vec<Option<(Vector<'g>, Vector<'g>)>> {
    let chain = Chain::new(graph, links, angles, q, tip, pose);
    let ways = chain.ways(graph, links, q, pose, split);
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
                let axes = &chain.rest[place];
                let linear = match ways.get(place) {
                    Some(way) => cross(axes[2], *way),
                    None => {
                        // z × arm, in the axes that the arm is in.
                        let [x, y, _] = chain.arm[place];
                        times(axes, [-y, x, graph.constant(0.0)])
                    }
                };
                (signed(linear), signed(axes[2]))
            }
        });
    }
    result
}
