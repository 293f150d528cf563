// SPDX-License-Identifier: MIT OR Apache-2.0
//! Joint-space inertia by the composite rigid body algorithm, and forward dynamics, which solves with it.

use super::links::Angles;
use super::vector::{Angle, Vector, add, constant, cross, turn, weigh, zero};
use crate::graph::{Expr, Graph};
use crate::robot::frames::Link;
use crate::robot::space::{M3, V3};

/// A symmetric matrix: xx, yy, zz, xy, xz, yz.
type Symmetric<'g> = [Expr<'g>; 6];

/// Mass and moments of a link with everything that it carries, about its origin.
#[derive(Clone, Copy)]
struct Composite<'g> {
    mass: f64,
    first: Vector<'g>,
    second: Symmetric<'g>,
}

/// Symmetric outer product of two vectors: `a bᵀ + b aᵀ`.
fn symmetric<'g>(a: V3, b: Vector<'g>) -> Symmetric<'g> {
    let entry = |i: usize, j: usize| {
        let mut k = [0.0; 3];
        k[j] += a[i];
        k[i] += a[j];
        weigh(k, b)
    };
    [entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)]
}

fn plus<'g>(a: Symmetric<'g>, b: Symmetric<'g>) -> Symmetric<'g> {
    std::array::from_fn(|i| a[i] + b[i])
}

/// Congruence transform: `m s mᵀ`.
fn conjugate<'g>(m: &M3, s: Symmetric<'g>) -> Symmetric<'g> {
    let [xx, yy, zz, xy, xz, yz] = s;
    let rows = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    // Columns of m s, then times mᵀ.
    let half: [Vector<'g>; 3] = std::array::from_fn(|j| turn(m, rows[j]));
    let entry = |i: usize, j: usize| weigh(m[j], [half[0][i], half[1][i], half[2][i]]);
    [entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)]
}

/// Turns a symmetric matrix about z with four products, because the sum of xx and yy is invariant.
fn about_z<'g>(angle: &Angle<'g>, s: Symmetric<'g>) -> Symmetric<'g> {
    let [xx, yy, zz, xy, xz, yz] = s;
    let (sin, cos) = (angle.sin, angle.cos);
    let part = sin * (xx - yy) + cos * (xy + xy);
    let moved = sin * part;
    let [xz, yz, _] = angle.out([xz, yz, zz]);
    [xx - moved, yy + moved, zz, cos * part - xy, xz, yz]
}

/// Lower triangle by row and column; `None` where the two joints are on different branches.
pub(super) type Matrix<'g> = Vec<Vec<Option<Expr<'g>>>>;

/// Lower triangle of the joint-space inertia.
pub(super) fn matrix<'g>(
    graph: &'g Graph,
    links: &[Link],
    angles: &Angles<'g>,
    q: &[Expr<'g>],
) -> Matrix<'g> {
    let mut whole: Vec<Composite<'g>> = links
        .iter()
        .map(|link| {
            let s = &link.body.second;
            let entries = [s[0][0], s[1][1], s[2][2], s[0][1], s[0][2], s[1][2]];
            let second = entries.map(|x| graph.constant(x));
            Composite { mass: link.body.mass, first: constant(graph, link.body.first), second }
        })
        .collect();
    let mut rows: Matrix<'g> = (0..links.len()).map(|row| vec![None; row + 1]).collect();
    for (index, link) in links.iter().enumerate().rev() {
        let body = whole[index];
        let [_, _, _, _, xz, yz] = body.second;
        let nothing = graph.constant(0.0);
        // Force and moment of a unit acceleration of the joint.
        let (force, moment) = match angles.own[index] {
            Some(_) => {
                let about = body.second[0] + body.second[1];
                ([-body.first[1], body.first[0], nothing], [-xz, -yz, about])
            }
            None => {
                let axis = constant(graph, link.axis);
                (axis.map(|x| body.mass * x), cross(body.first, axis))
            }
        };
        column(links, angles, q, index, (force, moment), &mut rows);
        let Some(parent) = link.parent else { continue };
        let moved = match angles.own[index] {
            Some(angle) => {
                let first = turn(&link.rest, angle.out(body.first));
                let second = conjugate(&link.rest, about_z(&angle, body.second));
                let shift = plus(symmetric(link.origin, first), {
                    let p = link.origin;
                    let k = body.mass;
                    [p[0] * p[0], p[1] * p[1], p[2] * p[2], p[0] * p[1], p[0] * p[2], p[1] * p[2]]
                        .map(|x| graph.constant(k * x))
                });
                let first = add(first, constant(graph, link.origin.map(|x| body.mass * x)));
                Composite { mass: body.mass, first, second: plus(second, shift) }
            }
            None => {
                let q = q[index];
                let axis = link.axis;
                let along = symmetric(axis, body.first).map(|x| q * x);
                let square = q.square();
                let far = [
                    axis[0] * axis[0],
                    axis[1] * axis[1],
                    axis[2] * axis[2],
                    axis[0] * axis[1],
                    axis[0] * axis[2],
                    axis[1] * axis[2],
                ]
                .map(|x| body.mass * x * square);
                let first = std::array::from_fn(|i| body.first[i] + body.mass * axis[i] * q);
                Composite { mass: body.mass, first, second: plus(plus(body.second, along), far) }
            }
        };
        let carrier = &mut whole[parent];
        carrier.mass += moved.mass;
        carrier.first = add(carrier.first, moved.first);
        carrier.second = plus(carrier.second, moved.second);
    }
    rows
}

/// Fills the row of a joint: its own entry, and the entries of its ancestors.
fn column<'g>(
    links: &[Link],
    angles: &Angles<'g>,
    q: &[Expr<'g>],
    row: usize,
    (mut force, mut moment): (Vector<'g>, Vector<'g>),
    rows: &mut Matrix<'g>,
) {
    let graph = q[row].graph();
    let nothing = graph.constant(0.0);
    let mut index = row;
    // Moments across the axis, in the frame before the turn of the group's first joint.
    let mut across = zero(graph);
    loop {
        let link = &links[index];
        let sign = link.sign * links[row].sign;
        let entry = if angles.own[index].is_some() { moment[2] } else { weigh(link.axis, force) };
        rows[row][index] = Some(if sign < 0.0 { -entry } else { entry });
        let Some(parent) = link.parent else { break };
        match (angles.own[index], angles.sum[index]) {
            (Some(own), Some(sum)) => {
                force = turn(&link.rest, own.out(force));
                let turned = sum.out(moment);
                across = add(across, [turned[0], turned[1], nothing]);
                moment = match angles.first[index] == index {
                    true => turn(&link.rest, [across[0], across[1], moment[2]]),
                    false => [nothing, nothing, moment[2]],
                };
                if angles.first[index] == index {
                    across = zero(graph);
                }
            }
            _ => {
                let arm = constant(graph, link.axis).map(|axis| axis * q[index]);
                moment = add(moment, cross(arm, force));
            }
        }
        moment = add(moment, cross(constant(graph, link.origin), force));
        index = parent;
    }
}

/// Solves `M x = forces` by elimination from the leaves (Featherstone's LᵀDL factorisation), which fills in no zero.
pub(super) fn solve<'g>(links: &[Link], mut m: Matrix<'g>, forces: Vec<Expr<'g>>) -> Vec<Expr<'g>> {
    let mut x = forces;
    let mut inverse: Vec<Expr<'g>> = x.clone();
    let carriers = |index: usize| std::iter::successors(links[index].parent, |&parent| links[parent].parent);
    for k in (0..links.len()).rev() {
        let Some(pivot) = m[k][k] else { continue };
        inverse[k] = (pivot.graph().constant(1.0) / pivot).named(format!("d{}", k + 1), "");
        for i in carriers(k) {
            let Some(entry) = m[k][i] else { continue };
            let factor = entry * inverse[k];
            for j in std::iter::once(i).chain(carriers(i)) {
                if let (Some(old), Some(by)) = (m[i][j], m[k][j]) {
                    m[i][j] = Some(old - factor * by);
                }
            }
            x[i] = x[i] - factor * x[k];
            m[k][i] = Some(factor);
        }
    }
    for k in 0..links.len() {
        x[k] = x[k] * inverse[k];
        for i in carriers(k) {
            if let Some(factor) = m[k][i] {
                x[k] = x[k] - factor * x[i];
            }
        }
    }
    x
}
