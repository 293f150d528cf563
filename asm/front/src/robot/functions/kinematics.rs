// SPDX-License-Identifier: MIT OR Apache-2.0
//! Kinematics of the tip: pose and Jacobian.

use super::links::Angles;
use super::vector::{Vector, add, constant, cross, turn, weigh};
use crate::graph::{Expr, Graph};
use crate::robot::Kind;
use crate::robot::frames::Link;
use crate::robot::space::{self, Pose};

/// Chain of joints from the base to `tip`.
pub(super) fn path(links: &[Link], tip: usize) -> Vec<usize> {
    let mut path: Vec<usize> = std::iter::successors(Some(tip), |&joint| links[joint].parent).collect();
    path.reverse();
    path
}

/// Axes of a frame in the base's frame, as columns.
type Axes<'g> = [Vector<'g>; 3];

fn columns<'g>(axes: &Axes<'g>, m: &space::M3) -> Axes<'g> {
    std::array::from_fn(|j| {
        std::array::from_fn(|i| weigh(space::column(m, j), [axes[0][i], axes[1][i], axes[2][i]]))
    })
}

fn times<'g>(axes: &Axes<'g>, a: Vector<'g>) -> Vector<'g> {
    std::array::from_fn(|i| a[0] * axes[0][i] + a[1] * axes[1][i] + a[2] * axes[2][i])
}

/// Position of a point of the last link as seen from each joint's origin, and in the base's frame. The recursion runs backwards; joints
/// about parallel axes add their arms, turned by sums of angles, in the frame of the first of them.
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
        // Contribution to the previous joint: the way to this joint's origin, plus everything beyond unless sums of angles add it.
        after = match angles.sum[index].is_some() && angles.first[index] != index {
            true => constant(graph, link.origin),
            false => add(constant(graph, link.origin), turn(&link.rest, arm[place])),
        };
    }
    (arm, after)
}

/// Kinematics of a tip, for each joint of its chain.
struct Chain<'g> {
    path: Vec<usize>,
    /// Axes of each joint's frame, after its turn.
    turned: Vec<Axes<'g>>,
    /// Axes before the turn, of the first joint of the group of parallel axes.
    rest: Vec<Axes<'g>>,
    /// Tip as seen from each joint's origin: in the axes of `rest` where the joint turns, of `turned` where it slides.
    arm: Vec<Vector<'g>>,
    /// Position of the tip in the base's frame.
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

    /// Vectors from the origins of the first `split` joints to the tip, in the base's frame.
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

/// Method of computing the nine entries of the tip's rotation. Of three perpendicular rows (or columns), two give the third as a cross
/// product, at the price of nine products and differences; turning two rows costs two thirds of turning three.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Third {
    /// Turn all three columns.
    Turned,
    /// Cross product for this row; the other two are turned from the base on.
    Row(usize),
    /// Cross product for this column; the other two are turned from the tip on.
    Column(usize),
}

impl Third {
    /// Every method, for the search to try.
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

/// Completes three perpendicular vectors: the vector at `third` becomes the cross product of the others.
fn completed<'g>(mut axes: Axes<'g>, third: usize) -> Axes<'g> {
    axes[third] = cross(axes[(third + 1) % 3], axes[(third + 2) % 3]);
    axes
}

fn transposed<'g>(axes: &Axes<'g>) -> Axes<'g> {
    std::array::from_fn(|i| std::array::from_fn(|j| axes[j][i]))
}

/// Direction fixed in the last link, in the base's frame; the recursion runs backwards and turns once for each group of parallel axes.
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

/// Rotation of the tip by rows, and its position. The position is computed backwards through the first `split` joints of the chain, sharing
/// their turns; the rest is added along the axes, which the rotation needs anyway.
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
            // Use the tip's own axes, which are outputs.
            None => times(&axes, constant(graph, turned_back(&pose.rotation, pose.origin))),
        };
        at = add(at, ahead);
    }
    (rotation, at)
}

/// Expresses a vector in the axes of a rotation.
fn turned_back(rotation: &space::M3, a: space::V3) -> space::V3 {
    space::cleaned_vector(space::turn(&space::transpose(rotation), a), 1.0)
}

/// For each joint of the chain, the linear and angular velocity of the tip per unit of joint velocity; `None` for other joints. The vector
/// from joint to tip is computed backwards in the joints' frames, except for the first `split` joints, where it is added along the base's
/// axes.
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
                        // The cross product z × arm, in the arm's axes.
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
