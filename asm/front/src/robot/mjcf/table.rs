// SPDX-License-Identifier: MIT OR Apache-2.0
//! Treatment of each element and attribute of MJCF, as of MuJoCo 4.0 and older releases. Parts not listed here are refused.

use super::super::xml::line;
use crate::Error;
use roxmltree::Node;
use takt_text::readers::{Row, Treatment, fate};

const fn computes(of: &'static str, parts: &'static str, text: &'static str) -> Row {
    Row { of, parts, fate: Treatment::Computes, text }
}

const fn passes(of: &'static str, parts: &'static str, text: &'static str) -> Row {
    Row { of, parts, fate: Treatment::PassesOver, text }
}

const fn refuses(of: &'static str, parts: &'static str, text: &'static str) -> Row {
    Row { of, parts, fate: Treatment::Refuses, text }
}

/// Elements of actuators, which share their defaults.
pub(super) const ACTUATORS: &str =
    "general motor position velocity intvelocity pid damper cylinder muscle dcmotor orientation adhesion";

/// Rows of the table. A refused attribute is accepted if its value is neutral: `false`, `auto`, 0 or below.
pub const TABLE: &[Row] = &[
    computes(
        "mujoco",
        "model compiler option default worldbody actuator tendon include",
        "sections that come again are merged",
    ),
    passes("mujoco", "size statistic visual asset contact sensor keyframe custom extension", ""),
    passes("mujoco", "equality", "joints are independent; a note names the lines"),
    refuses("mujoco", "deformable", ""),
    computes("compiler", "angle eulerseq inertiafromgeom inertiagrouprange", ""),
    refuses("compiler", "coordinate", "but `local`"),
    refuses("compiler", "boundmass boundinertia balanceinertia settotalmass", "masses are read as they are"),
    passes(
        "compiler",
        "alignfree assetdir autolimits conflict convexhull discardvisual exactmeshinertia fitaabb fusestatic lengthrange meshdir \
         passthrough savecanonical savecompiled saveinertial strippath texturedir usethread",
        "",
    ),
    computes("option", "gravity flag", "the last statement counts"),
    refuses("option", "density viscosity", "unless `flag` switches passive forces off"),
    passes(
        "option",
        "actuatorgroupdisable apirate ccd_iterations ccd_tolerance collision cone impratio integrator iterations jacobian ls_iterations \
         ls_tolerance magnetic mpr_iterations mpr_tolerance noslip_iterations noslip_tolerance o_friction o_margin o_solimp o_solref \
         sdf_initpoints sdf_iterations sleep_tolerance solver timestep tolerance wind",
        "the simulation's steps, solver and contacts; `wind` acts through a medium only",
    ),
    computes("flag", "gravity", "`disable`: no gravity"),
    computes(
        "flag",
        "spring damper",
        "`disable`: no stiffness; no damping, that of actuators included; both: no `gravcomp` either",
    ),
    computes("flag", "passive", "of MuJoCo before 3.3.6: `spring` and `damper`"),
    computes("flag", "frictionloss constraint", "`disable`: no friction"),
    passes(
        "flag",
        "actuation autoreset clampctrl contact diagexact energy equality eulerdamp filterparent fwdinv invdiscrete ipc island limit \
         midphase multiccd nativeccd override refsafe sensor sleep speculative warmstart",
        "the simulation's steps, contacts, limits and actuators' commands; with `eulerdamp` and `invdiscrete` MuJoCo computes for its \
         time step, the program for continuous time",
    ),
    computes("default", "class default joint geom tendon", ""),
    computes("default", ACTUATORS, "actuators of all kinds share their defaults"),
    passes("default", "mesh material texture site camera light pair equality", ""),
    computes("body", "name pos quat axisangle xyaxes zaxis euler childclass", "also of `worldbody`"),
    computes(
        "body",
        "body frame inertial joint freejoint geom",
        "the shapes' masses, where no `inertial` counts",
    ),
    computes("body", "gravcomp", "if all bodies that move have the same; refused otherwise"),
    passes("body", "site camera light mocap sleep user simple fuse", ""),
    refuses("body", "attach replicate composite flexcomp plugin", ""),
    computes("frame", "name pos quat axisangle xyaxes zaxis euler childclass", "contents as of a body"),
    computes("inertial", "pos quat axisangle xyaxes zaxis euler mass diaginertia fullinertia", ""),
    computes(
        "joint",
        "name class type pos axis ref",
        "`hinge` and `slide`; `free` is held, which a note says, or refused with `--floating error`; `ball` is refused unless before `--base` or held",
    ),
    computes(
        "joint",
        "armature damping frictionloss stiffness springref",
        "linear damping and stiffness: of three numbers the last two are 0",
    ),
    computes(
        "joint",
        "actuatorgravcomp",
        "at all joints: they bear the weight that `gravcomp` takes off; refused otherwise",
    ),
    refuses("joint", "springdamper", "state `stiffness` and `damping`"),
    refuses("joint", "springyield", ""),
    passes(
        "joint",
        "actuatorfrclimited actuatorfrcrange group limited margin range solimpfriction solimplimit solreffriction solreflimit user",
        "limits and the softness of friction",
    ),
    computes("freejoint", "name", "as a joint of type `free`"),
    passes("freejoint", "align group", ""),
    computes(
        "geom",
        "name class type size fromto pos quat axisangle xyaxes zaxis euler mass density group",
        "sphere, capsule, cylinder, ellipsoid, box",
    ),
    refuses("geom", "shellinertia", "where the shape gives its body mass"),
    refuses("geom", "mesh", "where the shape gives its body mass: it is in another file"),
    passes(
        "geom",
        "adhesion castshadow conaffinity condim contype fitscale fluidcoef fluidshape friction gap hfield margin material plugin priority \
         rgba solimp solmix solref surfacevel user",
        "appearance and contacts",
    ),
    refuses(
        "tendon",
        "stiffness damping frictionloss armature springyield",
        "if a joint that the tendon runs over moves in the part that is taken",
    ),
    passes(
        "tendon",
        "actuatorfrclimited actuatorfrcrange class group limited margin material name range rgba solimpfriction solimplimit \
         solreffriction solreflimit springlength user width joint site geom pulley",
        "a tendon without them only transmits",
    ),
    computes(
        "actuator",
        "armature damping gear",
        "armature and linear damping times gear² belong to the joint; refused at a tendon",
    ),
    computes("actuator", "joint jointinparent tendon class", ""),
    passes(
        "actuator",
        "actdim actearly actlimited actrange area bias biasprm biastype body cogging controller cranklength cranksite ctrllimited ctrlrange \
         dampratio delay diameter dynprm dyntype ffrange force forcelimited forcerange fpmax fvmax gain gainprm gaintype group imax \
         inductance inheritrange input instance interp ki kp kv lengthrange lmax lmin lugre motorconst name nominal nsample plugin \
         posrange range refsite resistance saturation scale site slewmax slidersite tausmooth thermal timeconst user velrange vmax config",
        "the actuator's law: ports are the joints' forces, whatever makes them",
    ),
];

/// Checks that every part of an element is listed, and that no child element is a refused one.
pub(super) fn check(of: &str, node: Node<'_, '_>) -> Result<(), Error> {
    let unknown = |at: Node<'_, '_>, part: &str| {
        let text = format!(
            "`{part}` of `{}` is not known: docs/readers.md lists what is read",
            node.tag_name().name()
        );
        Error::on(line(at), text)
    };
    let attributes = node.attributes().filter(|attribute| attribute.namespace().is_none());
    if let Some(attribute) =
        attributes.into_iter().find(|attribute| fate(TABLE, of, attribute.name()).is_none())
    {
        return Err(unknown(node, attribute.name()));
    }
    // A frame may have the contents of a body.
    let contents = if of == "frame" { "body" } else { of };
    for child in node.children().filter(Node::is_element) {
        match fate(TABLE, contents, child.tag_name().name()) {
            None => return Err(unknown(child, child.tag_name().name())),
            Some(Treatment::Refuses) => {
                let text = format!("`{}` is not read: {}", child.tag_name().name(), super::REMEDY);
                return Err(Error::on(line(child), text));
            }
            Some(_) => {}
        }
    }
    Ok(())
}

/// Refused attributes, with reasons.
pub(super) fn refused(of: &str) -> impl Iterator<Item = (&'static str, &'static str)> {
    let rows = TABLE.iter().filter(move |row| row.of == of && row.fate == Treatment::Refuses);
    rows.flat_map(|row| row.parts.split_ascii_whitespace().map(|part| (part, row.text)))
}

/// The value has no effect: `false`, `auto`, `local`, empty, or numbers of 0 or below.
pub(super) fn is_neutral(value: &str) -> bool {
    let value = value.trim();
    let numbers = || value.split_ascii_whitespace().map(str::parse::<f64>);
    matches!(value, "false" | "auto" | "local" | "") || numbers().all(|number| number.is_ok_and(|x| x <= 0.0))
}
