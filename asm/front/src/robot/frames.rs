// SPDX-License-Identifier: MIT OR Apache-2.0
//! Placement of each link's frame, so that the equations are short: every joint turns about its frame's z, and origins and x axes lie where
//! the transform from link to link has zeros (modified Denavit-Hartenberg frames). Inertia parameters that have the same effect in the
//! parent link are regrouped there as numbers, so that at most seven of the ten parameters of a turning link remain.

use super::space::{self, IDENTITY, Inertia, M3, Pose, V3};
use super::{Kind, Robot};

/// A joint with its frame.
#[derive(Clone, Debug)]
pub struct Link {
    /// Name of the joint in the description.
    pub name: String,
    /// Motion that the joint allows.
    pub kind: Kind,
    /// Parent joint; `None` on the base.
    pub parent: Option<usize>,
    /// The joint turns about the same direction as its parent, so that [`Link::rest`] is the identity.
    pub parallel: bool,
    /// 1, or -1 where the frame's z points against the joint's axis: the frame turns by `sign q + offset`.
    pub sign: f64,
    /// Angle of the frame at joint position 0, rad.
    pub offset: f64,
    /// Rotation from the parent's frame to this one at angle 0.
    pub rest: M3,
    /// Origin in the parent's frame (of a joint that slides, at position 0), m.
    pub origin: V3,
    /// Direction of the joint's axis in the parent's frame.
    pub axis: V3,
    /// Mass and moments of the body, after regrouping.
    pub body: Inertia,
    /// Pose of the description's frame in this one.
    pub own: Pose,
}

/// Choices among valid placements: [`place`] accepts any; the search minimises the equations.
#[derive(Clone, PartialEq, Debug)]
pub struct Layout {
    /// By joint: the origin lies at the foot of the normal from the previous joint, otherwise of the normal to the next.
    pub incoming: Vec<bool>,
    /// By joint: the x axis of a link without children passes through its centre of mass.
    pub balanced: Vec<bool>,
    /// Extra quarter turns of each x axis, 0 to 3: free of cost, they decide which signs are needed.
    pub quarters: Vec<u8>,
    /// By joint: the z axis points against the joint's axis; decides which signs are needed.
    pub flipped: Vec<bool>,
}

impl Layout {
    /// Origins at the normals to the next joints, axes without an offset.
    pub fn new(robot: &Robot) -> Layout {
        let count = robot.joints.len();
        let no = vec![false; count];
        Layout { incoming: no.clone(), balanced: no.clone(), quarters: vec![0; count], flipped: no }
    }
}

/// Sine of an angle below which two axes count as parallel.
const PARALLEL: f64 = 1e-9;
/// Sine of an angle above which the common normal is well determined.
const SKEW: f64 = 0.02;

/// A joint axis in space: a point and a direction.
#[derive(Clone, Copy)]
struct Line {
    point: V3,
    direction: V3,
}

/// Distance along `line` to the foot of the common normal with `other`; `None` if the lines are parallel or nearly so.
fn foot(line: Line, other: Line) -> Option<f64> {
    let normal = space::cross(line.direction, other.direction);
    let square = space::dot(normal, normal);
    let between = space::sub(other.point, line.point);
    (square > SKEW * SKEW).then(|| space::dot(space::cross(between, other.direction), normal) / square)
}

fn parallel(a: V3, b: V3) -> bool {
    space::norm(space::cross(a, b)) < PARALLEL
}

fn normalised(a: V3) -> V3 {
    space::scale(1.0 / space::norm(a), a)
}

/// Geometry at position 0, from which the frames are placed.
struct Geometry<'a> {
    robot: &'a Robot,
    /// Frames of the bodies at position 0, in the base's frame.
    world: Vec<Pose>,
    lines: Vec<Line>,
    /// For each joint, the child that carries most joints.
    next: Vec<Option<usize>>,
    /// Placed frames at position 0, in the base's frame, as far as computed.
    frames: Vec<Pose>,
}

impl<'a> Geometry<'a> {
    fn new(robot: &'a Robot, layout: &Layout) -> Geometry<'a> {
        let count = robot.joints.len();
        let mut world: Vec<Pose> = Vec::with_capacity(count);
        for joint in &robot.joints {
            world.push(joint.parent.map_or(joint.place, |parent| world[parent].then(&joint.place)));
        }
        let mut lines: Vec<Line> = Vec::with_capacity(count);
        for (index, (joint, pose)) in robot.joints.iter().zip(&world).enumerate() {
            let mut direction = space::turn(&pose.rotation, joint.axis);
            if layout.flipped[index] {
                direction = space::scale(-1.0, direction);
            }
            // Parallel axes get the same direction, so that their angles add up.
            let mut carrier = robot.joints[index].parent;
            while let Some(before) = carrier.filter(|before| robot.joints[*before].kind == Kind::Prismatic) {
                carrier = robot.joints[before].parent;
            }
            if let Some(before) = carrier.filter(|before| parallel(direction, lines[*before].direction))
                && joint.kind == Kind::Revolute
            {
                direction = lines[before].direction;
            }
            lines.push(Line { point: pose.origin, direction });
        }
        let mut size = vec![1; count];
        for index in (0..count).rev() {
            if let Some(parent) = robot.joints[index].parent {
                size[parent] += size[index];
            }
        }
        let mut next: Vec<Option<usize>> = vec![None; count];
        for (index, joint) in robot.joints.iter().enumerate() {
            if let Some(parent) = joint.parent
                && next[parent].is_none_or(|other| size[index] > size[other])
            {
                next[parent] = Some(index);
            }
        }
        Geometry { robot, world, lines, next, frames: Vec::with_capacity(count) }
    }

    fn revolute(&self, joint: Option<usize>) -> Option<usize> {
        joint.filter(|&joint| self.robot.joints[joint].kind == Kind::Revolute)
    }

    /// The two joints have parallel axes.
    fn together(&self, a: usize, b: usize) -> bool {
        parallel(self.lines[a].direction, self.lines[b].direction)
    }

    /// Origin of a joint's frame, on its axis. Joints on parallel axes get the same height.
    fn origin(&self, joint: usize, layout: &Layout) -> V3 {
        let line = self.lines[joint];
        let carrier = |joint: usize| self.revolute(self.robot.joints[joint].parent);
        let mut first = joint;
        while let Some(before) =
            carrier(first).filter(|before| self.together(*before, first) && self.next[*before] == Some(first))
        {
            first = before;
        }
        let mut last = joint;
        while let Some(after) = self.revolute(self.next[last]).filter(|after| self.together(*after, last)) {
            last = after;
        }
        let along = |from: usize, distance: f64| {
            let start = self.lines[from];
            space::dot(space::sub(start.point, line.point), line.direction) + distance
        };
        let outgoing = self
            .revolute(self.next[last])
            .and_then(|next| foot(self.lines[last], self.lines[next]).map(|distance| along(last, distance)));
        let incoming = carrier(first).and_then(|before| {
            foot(self.lines[first], self.lines[before]).map(|distance| along(first, distance))
        });
        let (one, other) = if layout.incoming[first] { (incoming, outgoing) } else { (outgoing, incoming) };
        let distance = one.or(other).unwrap_or_else(|| along(first, 0.0));
        space::add(line.point, space::scale(distance, line.direction))
    }

    /// Direction of a joint's x axis, if the geometry prefers one.
    fn x_axis(&self, joint: usize, layout: &Layout) -> Option<V3> {
        let line = self.lines[joint];
        let Some(next) = self.next[joint] else {
            let body = self.robot.joints[joint].body.outside(&self.world[joint]);
            // Moments about a point on the axis.
            let first = space::sub(body.first, space::scale(body.mass, line.point));
            let height = space::dot(first, line.direction);
            let across = space::sub(first, space::scale(height, line.direction));
            let worth = layout.balanced[joint] && space::norm(across) > 1e-9 * space::norm(first);
            return worth.then(|| normalised(across));
        };
        let direction = self.lines[next].direction;
        if !parallel(line.direction, direction) {
            return Some(normalised(space::cross(line.direction, direction)));
        }
        let between = space::sub(self.lines[next].point, line.point);
        let height = space::dot(between, line.direction);
        let across = space::sub(between, space::scale(height, line.direction));
        (space::norm(across) > 1e-9).then(|| normalised(across))
    }
}

/// Rotation from the parent's frame to one with `axis` as its z, with as many zeros as possible.
fn rest(axis: V3) -> M3 {
    for i in 0..3 {
        if axis[i].abs() == 1.0 {
            let x: V3 = std::array::from_fn(|j| f64::from(j == (i + 1) % 3));
            return space::columns(x, space::cross(axis, x), axis);
        }
    }
    match axis {
        [0.0, y, z] => space::about(0, (-y).atan2(z)),
        [x, 0.0, z] => space::about(1, x.atan2(z)),
        [x, y, z] => space::product(&space::about(2, x.atan2(-y)), &space::about(0, z.acos())),
    }
}

/// The links of a robot in the frames of `layout`, with regrouped inertias.
pub fn place(robot: &Robot, layout: &Layout) -> Vec<Link> {
    let mut geometry = Geometry::new(robot, layout);
    let mut links: Vec<Link> = Vec::with_capacity(robot.joints.len());
    for (index, joint) in robot.joints.iter().enumerate() {
        let carrier = joint.parent.map_or(Pose::IDENTITY, |parent| geometry.frames[parent]);
        let line = geometry.lines[index];
        let back = space::transpose(&carrier.rotation);
        let axis = space::turn(&space::cleaned(&back), line.direction);
        let axis = if joint.kind == Kind::Prismatic && layout.flipped[index] {
            space::scale(-1.0, axis)
        } else {
            axis
        };
        let axis = normalised(axis.map(|x| if (x - x.round()).abs() < 1e-9 { x.round() } else { x }));
        let beside = geometry.revolute(joint.parent).is_some_and(|parent| geometry.together(parent, index));
        let mut link = Link {
            name: joint.name.clone(),
            kind: joint.kind,
            parent: joint.parent,
            parallel: beside && joint.kind == Kind::Revolute,
            sign: 1.0,
            offset: 0.0,
            rest: IDENTITY,
            origin: [0.0; 3],
            axis,
            body: Inertia::default(),
            own: Pose::IDENTITY,
        };
        let frame = match joint.kind {
            Kind::Prismatic => carrier,
            Kind::Revolute => {
                link.rest = if link.parallel { IDENTITY } else { rest(axis) };
                link.axis = space::column(&link.rest, 2);
                let mut frame = Pose {
                    rotation: space::product(&carrier.rotation, &link.rest),
                    origin: geometry.origin(index, layout),
                };
                if let Some(x) = geometry.x_axis(index, layout) {
                    let [x, y, _] = space::turn(&space::transpose(&frame.rotation), x);
                    let angle = y.atan2(x);
                    let turns = (angle / std::f64::consts::FRAC_PI_2).round() * std::f64::consts::FRAC_PI_2;
                    link.offset = if (angle - turns).abs() < 1e-9 { turns } else { angle };
                }
                link.offset += f64::from(layout.quarters[index]) * std::f64::consts::FRAC_PI_2;
                frame.rotation = space::product(&frame.rotation, &space::about(2, link.offset));
                link.origin = carrier.inverse().point(frame.origin);
                let own = space::turn(&geometry.world[index].rotation, joint.axis);
                link.sign = if space::dot(own, line.direction) < 0.0 { -1.0 } else { 1.0 };
                frame
            }
        };
        link.origin = space::cleaned_vector(link.origin, 1.0);
        link.own = frame.inverse().then(&geometry.world[index]);
        link.body = joint.body.outside(&link.own);
        geometry.frames.push(frame);
        links.push(link);
    }
    regroup(&mut links);
    links
}

/// Regroups inertia parameters into the parent link. A turning joint does not feel mass on its axis, wherever on the axis; a sliding joint
/// keeps orientation, and so feels no second moments.
fn regroup(links: &mut [Link]) {
    for index in (0..links.len()).rev() {
        let link = &mut links[index];
        let mut moved = Inertia::default();
        match link.kind {
            Kind::Revolute => {
                let body = &mut link.body;
                moved.mass = std::mem::take(&mut body.mass);
                moved.first[2] = std::mem::take(&mut body.first[2]);
                moved.second[2][2] = std::mem::take(&mut body.second[2][2]);
            }
            Kind::Prismatic => moved.second = std::mem::take(&mut link.body.second),
        }
        let pose = Pose { rotation: link.rest, origin: link.origin };
        if let Some(parent) = link.parent {
            links[parent].body = links[parent].body.plus(&moved.outside(&pose));
        }
    }
    // Sums that cancelled except for rounding are zero.
    let size = |entries: &[f64]| entries.iter().fold(0.0, |size: f64, entry| size.max(entry.abs()));
    let first = links.iter().map(|link| size(&link.body.first)).fold(0.0, f64::max);
    let second = links.iter().map(|link| size(link.body.second.as_flattened())).fold(0.0, f64::max);
    for link in links {
        link.body.first = space::cleaned_vector(link.body.first, first);
        link.body.second = link.body.second.map(|row| space::cleaned_vector(row, second));
    }
}
