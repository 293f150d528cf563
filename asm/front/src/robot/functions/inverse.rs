// SPDX-License-Identifier: MIT OR Apache-2.0
//! Inverse dynamics: the joint forces of a motion, by the recursive Newton-Euler algorithm in the links' own frames.

use super::links::{Angles, Motion, State, motions};
use super::vector::{Vector, add, constant, cross, turn, weigh, zero};
use crate::graph::{Expr, Graph};
use crate::robot::frames::Link;
use crate::robot::space::V3;

/// Force and moment of a link's motion, at its origin.
fn load<'g>(graph: &'g Graph, link: &Link, state: &State<'g>) -> (Vector<'g>, Vector<'g>) {
    let body = &link.body;
    let first = constant(graph, body.first);
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = body.second.map(|row| constant(graph, row));
    let u = &state.u;
    let [d1, d2, d3] = state.differences;
    let force = std::array::from_fn(|i| {
        let turning = u[i][0] * first[0] + u[i][1] * first[1] + u[i][2] * first[2];
        turning + body.mass * state.a[i]
    });
    // The axial part of U S, with S = ∫ r rᵀ dm.
    let moment = [
        yy * u[2][1] - zz * u[1][2] + yz * d1 + xy * u[2][0] - xz * u[1][0],
        zz * u[0][2] - xx * u[2][0] + xz * d2 + yz * u[0][1] - xy * u[2][1],
        xx * u[1][0] - yy * u[0][1] + xy * d3 + xz * u[1][2] - yz * u[0][2],
    ];
    (force, add(moment, cross(first, state.a)))
}

/// Joint forces of a motion.
pub(super) fn forces<'g>(
    graph: &'g Graph,
    links: &[Link],
    gravity: V3,
    angles: &Angles<'g>,
    motion: &[Motion<'g>],
) -> Vec<Expr<'g>> {
    let states = motions(graph, links, gravity, angles, motion);
    let loads: Vec<_> = links.iter().zip(&states).map(|(link, state)| load(graph, link, state)).collect();
    let (mut force, mut moment): (Vec<Vector<'g>>, Vec<Vector<'g>>) = loads.into_iter().unzip();
    // Moments across the axis, gathered at the first joint of each group of parallel axes.
    let mut across: Vec<Vector<'g>> = vec![zero(graph); links.len()];
    let mut result = vec![graph.constant(0.0); links.len()];
    for (index, link) in links.iter().enumerate().rev() {
        let number = index + 1;
        let name = |what: &str, value: Vector<'g>, text: &str| -> Vector<'g> {
            let text = format!("{text} of link {number} and all behind it, in its frame");
            std::array::from_fn(|i| value[i].named(format!("{what}{number}{}", ["x", "y", "z"][i]), &text))
        };
        let f = name("f", force[index], "force");
        let n = name("n", moment[index], "moment");
        let (outer_force, outer_moment) = match (angles.own[index], angles.sum[index]) {
            (Some(own), Some(sum)) => {
                result[index] = if link.sign < 0.0 { -n[2] } else { n[2] };
                let first = angles.first[index];
                let turned = sum.out(n);
                across[first] = add(across[first], [turned[0], turned[1], graph.constant(0.0)]);
                let outer_force = turn(&link.rest, own.out(f));
                let rest = match first == index {
                    true => turn(&link.rest, [across[index][0], across[index][1], n[2]]),
                    // The first joint of the group already has the force across the axis.
                    false => [graph.constant(0.0), graph.constant(0.0), n[2]],
                };
                (outer_force, rest)
            }
            _ => {
                result[index] = weigh(link.axis, f);
                let arm = constant(graph, link.axis).map(|axis| axis * motion[index].q);
                (f, add(n, cross(arm, f)))
            }
        };
        if let Some(parent) = link.parent {
            let arm = constant(graph, link.origin);
            force[parent] = add(force[parent], outer_force);
            moment[parent] = add(moment[parent], add(outer_moment, cross(arm, outer_force)));
        }
    }
    result
}
