// SPDX-License-Identifier: MIT OR Apache-2.0
//! Motion of the links: velocities and accelerations in each link's own frame, from the base outwards.
//!
//! The acceleration of a point `r` of a link is `a + U r`, with `U = [dω]× + [ω]×[ω]×` (Khalil and Kleinfinger, 1987). A column of U is the
//! acceleration of a point on an axis relative to the origin; points on the joint's own axis move alike in the link and in its parent. So
//! the last column of U is only turned from link to link, and the rest of U and of the angular acceleration follows from it and from
//! products of ω.

use super::vector::{Angle, Vector, add, constant, cross, turn_back, weigh, zero};
use crate::graph::{Expr, Graph};
use crate::robot::frames::Link;
use crate::robot::{Kind, space};

/// Motion of a joint: position, velocity and acceleration; zero constants where the function has no such input.
#[derive(Clone, Copy)]
pub(super) struct Motion<'g> {
    pub(super) q: Expr<'g>,
    pub(super) qd: Expr<'g>,
    pub(super) qdd: Expr<'g>,
}

/// Motion of a link, in its frame.
#[derive(Clone, Copy)]
pub(super) struct State<'g> {
    /// Angular velocity ω, rad/s.
    pub(super) w: Vector<'g>,
    /// Angular acceleration, rad/s²; only the components that a child link needs are valid.
    pub(super) wd: Vector<'g>,
    /// Matrix U by rows, 1/s².
    pub(super) u: [Vector<'g>; 3],
    /// U_zz - U_yy, U_xx - U_zz, U_yy - U_xx.
    pub(super) differences: Vector<'g>,
    /// Acceleration of the origin minus free fall's, m/s².
    pub(super) a: Vector<'g>,
}

/// Angles of the joints: each joint's own, and its sum over the group of parallel axes.
pub(super) struct Angles<'g> {
    /// Angle of the joint alone; `None` for a sliding joint.
    pub(super) own: Vec<Option<Angle<'g>>>,
    /// Sum of angles since the first joint of the group; `None` for a sliding joint.
    pub(super) sum: Vec<Option<Angle<'g>>>,
    /// First joint of the group of parallel axes.
    pub(super) first: Vec<usize>,
}

/// Sine and cosine of a sum of inputs plus a constant; quarter turns cost nothing.
fn angle<'g>(sum: Option<Expr<'g>>, number: f64, graph: &'g Graph, names: &(String, String)) -> Angle<'g> {
    use std::f64::consts::FRAC_PI_2;
    let turns = (number / FRAC_PI_2).round();
    let rest = number - turns * FRAC_PI_2;
    let rest = if rest.abs() < 1e-9 { 0.0 } else { rest };
    let mut argument = sum.unwrap_or_else(|| graph.constant(0.0));
    if rest != 0.0 {
        argument = argument + graph.constant(rest);
    }
    let sin = argument.sin().named(&names.0, "");
    let cos = argument.cos().named(&names.1, "");
    let (sin, cos) = match turns.rem_euclid(4.0) as u8 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    };
    Angle { sin, cos }
}

impl<'g> Angles<'g> {
    /// With `sums`, joints about parallel axes form groups, and each turns its quantities directly from the parent of the group's first
    /// joint.
    pub(super) fn new(graph: &'g Graph, links: &[Link], q: &[Expr<'g>], sums: bool) -> Angles<'g> {
        let mut angles = Angles { own: Vec::new(), sum: Vec::new(), first: Vec::new() };
        let mut totals: Vec<(Expr<'g>, f64, String)> = Vec::new();
        for (index, link) in links.iter().enumerate() {
            let signed = if link.sign < 0.0 { -q[index] } else { q[index] };
            let number = index + 1;
            let first = match link.parent.filter(|_| link.parallel && sums) {
                Some(parent) => angles.first[parent],
                None => index,
            };
            angles.first.push(first);
            let names = (format!("s{number}"), format!("c{number}"));
            let own = angle(Some(signed), link.offset, graph, &names);
            let (sum, offset, name) = match link.parent.filter(|_| first != index) {
                Some(parent) => {
                    let (sum, offset, name) = totals[parent].clone();
                    (sum + signed, offset + link.offset, format!("{name}_{number}"))
                }
                None => (signed, link.offset, number.to_string()),
            };
            let whole = match first == index {
                true => own,
                false => angle(Some(sum), offset, graph, &(format!("s{name}"), format!("c{name}"))),
            };
            totals.push((sum, offset, name));
            let turns = link.kind == Kind::Revolute;
            angles.own.push(turns.then_some(own));
            angles.sum.push(turns.then_some(whole));
        }
        angles
    }
}

/// Components of each link's angular acceleration that its children need.
fn needs(links: &[Link]) -> Vec<[bool; 3]> {
    let mut needs = vec![[false; 3]; links.len()];
    for index in (0..links.len()).rev() {
        let link = &links[index];
        let Some(parent) = link.parent else { continue };
        let own = needs[index];
        for (axis, need) in needs[parent].iter_mut().enumerate() {
            *need |= match link.kind {
                Kind::Revolute => link.axis[axis] != 0.0,
                Kind::Prismatic => own[axis],
            };
        }
    }
    needs
}

/// Motion of every link.
pub(super) fn motions<'g>(
    graph: &'g Graph,
    links: &[Link],
    gravity: space::V3,
    angles: &Angles<'g>,
    motions: &[Motion<'g>],
) -> Vec<State<'g>> {
    let needs = needs(links);
    let base = State {
        w: zero(graph),
        wd: zero(graph),
        u: [zero(graph); 3],
        differences: zero(graph),
        a: constant(graph, space::scale(-1.0, gravity)),
    };
    let mut states: Vec<State<'g>> = Vec::with_capacity(links.len());
    // Angular velocity and the axial column of U, before the sum of angles turns them.
    let mut rests: Vec<(Vector<'g>, Vector<'g>)> = Vec::with_capacity(links.len());
    for (index, link) in links.iter().enumerate() {
        let before = link.parent.map_or(base, |parent| states[parent]);
        let motion = motions[index];
        let along = |m: &[Vector<'g>; 3], a: space::V3| m.map(|row| weigh(a, row));
        let shifted = add(before.a, along(&before.u, link.origin));
        let (Some(own), Some(sum)) = (angles.own[index], angles.sum[index]) else {
            states.push(slide(link, &before, shifted, motion));
            rests.push((before.w, zero(graph)));
            continue;
        };
        let first = angles.first[index];
        let (w, column) = match link.parent.filter(|_| first != index) {
            // Relative to the first joint of the group of parallel axes.
            Some(_) => rests[first],
            None => (turn_back(&link.rest, before.w), turn_back(&link.rest, along(&before.u, link.axis))),
        };
        rests.push((w, column));
        let rate = if link.sign < 0.0 { -motion.qd } else { motion.qd };
        let push = if link.sign < 0.0 { -motion.qdd } else { motion.qdd };
        let along_axis = weigh(link.axis, before.w);
        let [wx, wy, _] = sum.into(w);
        let number = index + 1;
        let name = |what: &str, axis: &str| format!("{what}{number}{axis}");
        let text = format!("angular velocity of link {number}, in its frame, rad/s");
        let wx = wx.named(name("w", "x"), &text);
        let wy = wy.named(name("w", "y"), &text);
        let wz = (along_axis + rate).named(name("w", "z"), &text);
        let [xz, yz, zz] = sum.into(column);
        let wdz = weigh(link.axis, before.wd) + push;
        // U + Uᵀ = 2 (ω ωᵀ - |ω|²), U - Uᵀ = 2 [dω]×.
        let twice = wz + wz;
        let (zy, wdx) = match needs[index][0] {
            true => {
                let product = wy * wz;
                let wdx = product - yz;
                (product + wdx, wdx)
            }
            false => (wy * twice - yz, graph.constant(0.0)),
        };
        let (zx, wdy) = match needs[index][1] {
            true => {
                let product = wx * wz;
                let wdy = xz - product;
                (product - wdy, wdy)
            }
            false => (wx * twice - xz, graph.constant(0.0)),
        };
        let product = wx * wy;
        let (xy, yx) = (product - wdz, product + wdz);
        let (yy_square, zz_square) = (wy.square(), wz.square());
        let d1 = zz_square - yy_square;
        let xx = -(yy_square + zz_square);
        let yy = zz - d1;
        let d2 = xx - zz;
        let d3 = yy - xx;
        let a = own.into(turn_back(&link.rest, shifted));
        let text = format!("acceleration of the origin of link {number}, less that of free fall");
        let a = std::array::from_fn(|i| a[i].named(name("a", ["x", "y", "z"][i]), &text));
        let entry = |value: Expr<'g>, axes: &str| {
            value.named(
                name("u", axes),
                format!("acceleration of points of link {number} relative to its origin, 1/s²"),
            )
        };
        states.push(State {
            w: [wx, wy, wz],
            wd: [wdx, wdy, wdz],
            u: [
                [entry(xx, "xx"), entry(xy, "xy"), entry(xz, "xz")],
                [entry(yx, "yx"), entry(yy, "yy"), entry(yz, "yz")],
                [entry(zx, "zx"), entry(zy, "zy"), entry(zz, "zz")],
            ],
            differences: [d1, d2, d3],
            a,
        });
    }
    states
}

/// Motion of a sliding link, which turns with its parent.
fn slide<'g>(link: &Link, before: &State<'g>, shifted: Vector<'g>, motion: Motion<'g>) -> State<'g> {
    let graph = motion.q.graph();
    let axis = constant(graph, link.axis);
    let twice = motion.qd + motion.qd;
    let turning = cross(before.w, axis);
    let a = std::array::from_fn(|i| {
        shifted[i] + motion.q * weigh(link.axis, before.u[i]) + twice * turning[i] + motion.qdd * axis[i]
    });
    State { a, ..*before }
}
