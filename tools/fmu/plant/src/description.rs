// SPDX-License-Identifier: MIT OR Apache-2.0
//! The description of an FMU, `modelDescription.xml`: as much of it as a master of one FMU with fixed steps needs.

use roxmltree::{Document, Node};

/// Version of the standard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0.
    Two,
    /// FMI 3.0.
    Three,
}

/// Role of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Causality {
    /// Set by the master before each step.
    Input,
    /// Read after each step.
    Output,
    /// May be set before the initialisation.
    Start,
    /// Of no use here.
    Other,
}

/// Type of a variable's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Binary64: `Real`, `Float64`.
    Float64,
    /// `Float32`.
    Float32,
    /// `Integer` and `Enumeration` of FMI 2.0, `Int32`.
    Int32,
    /// `UInt32`.
    UInt32,
    /// `Int64` and `Enumeration` of FMI 3.0.
    Int64,
    /// `Boolean`: 0 or 1.
    Boolean,
}

/// A scalar variable that is a number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variable {
    /// Name, such as `body.x[1]`.
    pub name: String,
    /// Value reference.
    pub reference: u32,
    /// Type.
    pub kind: Kind,
    /// Role.
    pub causality: Causality,
}

/// Description of a co-simulation FMU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Description {
    /// Version of the standard.
    pub version: Version,
    /// Name of the model.
    pub name: String,
    /// Name of the library without its extension.
    pub identifier: String,
    /// GUID or instantiation token.
    pub token: String,
    /// Variables that are scalar numbers; all others are left out.
    pub variables: Vec<Variable>,
}

/// Largest number of variables.
const VARIABLES: usize = 1_000_000;

impl Description {
    /// Reads the text of a description.
    ///
    /// # Errors
    /// If the text is no description of a co-simulation FMU 2.0 or 3.0; in words.
    pub fn read(text: &str) -> Result<Description, String> {
        let document =
            Document::parse(text).map_err(|error| format!("modelDescription.xml is no XML: {error}"))?;
        let root = document.root_element();
        if root.tag_name().name() != "fmiModelDescription" {
            return Err(
                "modelDescription.xml describes no FMU: its root is no fmiModelDescription".to_owned()
            );
        }
        let attribute = |node: Node<'_, '_>, name: &str| -> Result<String, String> {
            let tag = node.tag_name().name().to_owned();
            let value = node.attribute(name).filter(|value| !value.is_empty());
            value.map(str::to_owned).ok_or_else(|| format!("modelDescription.xml: <{tag}> has no `{name}`"))
        };
        let version = match attribute(root, "fmiVersion")?.as_str() {
            "2.0" => Version::Two,
            three if three == "3.0" || three.starts_with("3.0.") => Version::Three,
            other => {
                return Err(format!(
                    "it is an FMU of FMI {other}; Takt reads 2.0 and 3.0: export it in one of these versions"
                ));
            }
        };
        let child = |name: &str| root.children().find(|node| node.has_tag_name(name));
        let Some(simulation) = child("CoSimulation") else {
            let only =
                ["ModelExchange", "ScheduledExecution"].into_iter().filter(|name| child(name).is_some());
            let only: Vec<&str> = only.collect();
            let kinds =
                if only.is_empty() { "nothing that can be run".to_owned() } else { only.join(" and ") };
            return Err(format!(
                "it is for {kinds} only, without a solver of its own; export it for co-simulation"
            ));
        };
        let token = if version == Version::Two { "guid" } else { "instantiationToken" };
        let variables = child("ModelVariables").ok_or("modelDescription.xml has no <ModelVariables>")?;
        let elements = variables.children().filter(Node::is_element);
        let read = |node: Node<'_, '_>| variable(node, version).transpose();
        let variables: Vec<Variable> =
            elements.filter_map(read).take(VARIABLES + 1).collect::<Result<_, _>>()?;
        if variables.len() > VARIABLES {
            return Err(format!("it has more than {VARIABLES} variables"));
        }
        Ok(Description {
            version,
            name: attribute(root, "modelName")?,
            identifier: attribute(simulation, "modelIdentifier")?,
            token: attribute(root, token)?,
            variables,
        })
    }

    /// Variables of a role, with their positions among all.
    pub fn of(&self, causality: Causality) -> impl Iterator<Item = (usize, &Variable)> {
        self.variables.iter().enumerate().filter(move |(_, variable)| variable.causality == causality)
    }
}

/// One variable; `None` for those that are no scalar numbers.
fn variable(node: Node<'_, '_>, version: Version) -> Result<Option<Variable>, String> {
    let typed = match version {
        Version::Two => node.children().find(Node::is_element),
        // An array has dimensions.
        Version::Three => {
            Some(node).filter(|node| !node.children().any(|child| child.has_tag_name("Dimension")))
        }
    };
    let Some(typed) = typed else { return Ok(None) };
    let kind = match (version, typed.tag_name().name()) {
        (Version::Two, "Real") | (Version::Three, "Float64") => Kind::Float64,
        (Version::Three, "Float32") => Kind::Float32,
        (Version::Two, "Integer" | "Enumeration") | (Version::Three, "Int32") => Kind::Int32,
        (Version::Three, "UInt32") => Kind::UInt32,
        (Version::Three, "Int64" | "Enumeration") => Kind::Int64,
        (_, "Boolean") => Kind::Boolean,
        _ => return Ok(None),
    };
    let name = node.attribute("name").ok_or("modelDescription.xml has a variable without a name")?;
    let reference = node.attribute("valueReference").and_then(|text| text.parse().ok());
    let reference =
        reference.ok_or_else(|| format!("modelDescription.xml: `{name}` has no value reference"))?;
    let variability = node.attribute("variability").unwrap_or_default();
    let causality = match node.attribute("causality").unwrap_or("local") {
        "input" => Causality::Input,
        "output" => Causality::Output,
        "parameter" | "structuralParameter" => Causality::Start,
        "local" if typed.attribute("start").is_some() && variability != "constant" => Causality::Start,
        _ => Causality::Other,
    };
    Ok(Some(Variable { name: name.to_owned(), reference, kind, causality }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two(kind: &str, variables: &str) -> String {
        format!(
            "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"m\" guid=\"g\">{kind}<ModelVariables>{variables}</ModelVariables></fmiModelDescription>"
        )
    }

    #[test]
    fn what_a_description_says() {
        let text = two(
            "<ModelExchange modelIdentifier=\"a\"/><CoSimulation modelIdentifier=\"b\"/>",
            "<ScalarVariable name=\"u\" valueReference=\"1\" causality=\"input\"><Real start=\"0\"/></ScalarVariable>\
             <ScalarVariable name=\"n\" valueReference=\"2\" causality=\"output\"><Integer/></ScalarVariable>\
             <ScalarVariable name=\"on\" valueReference=\"3\" causality=\"parameter\"><Boolean start=\"true\"/></ScalarVariable>\
             <ScalarVariable name=\"x\" valueReference=\"4\"><Real/></ScalarVariable>\
             <ScalarVariable name=\"text\" valueReference=\"5\" causality=\"parameter\"><String start=\"\"/></ScalarVariable>",
        );
        let read = Description::read(&text).unwrap();
        assert_eq!((read.version, read.identifier.as_str(), read.token.as_str()), (Version::Two, "b", "g"));
        let told: Vec<_> = read.variables.iter().map(|v| (v.name.as_str(), v.kind, v.causality)).collect();
        assert_eq!(
            told,
            [
                ("u", Kind::Float64, Causality::Input),
                ("n", Kind::Int32, Causality::Output),
                ("on", Kind::Boolean, Causality::Start),
                ("x", Kind::Float64, Causality::Other)
            ]
        );
        let three = "<fmiModelDescription fmiVersion=\"3.0\" modelName=\"m\" instantiationToken=\"t\"><CoSimulation modelIdentifier=\"b\"/>\
             <ModelVariables><Float64 name=\"v\" valueReference=\"1\" causality=\"output\"><Dimension start=\"3\"/></Float64>\
             <Float32 name=\"w\" valueReference=\"2\" causality=\"output\"/></ModelVariables></fmiModelDescription>";
        let read = Description::read(three).unwrap();
        assert_eq!((read.variables.len(), read.variables[0].kind), (1, Kind::Float32));
    }

    #[test]
    fn others_are_refused_by_name() {
        let refused = |text: &str, expected: &str| {
            let error = Description::read(text).unwrap_err();
            assert!(error.contains(expected), "{error}");
        };
        refused(&two("<ModelExchange modelIdentifier=\"a\"/>", ""), "for ModelExchange only");
        refused(&two("<CoSimulation/>", ""), "<CoSimulation> has no `modelIdentifier`");
        refused(&two("<CoSimulation modelIdentifier=\"a\"/>", "").replace("2.0", "1.0"), "FMI 1.0");
        refused("<a/>", "no FMU");
        refused("<a>", "no XML");
        let nameless = "<ScalarVariable valueReference=\"1\"><Real/></ScalarVariable>";
        refused(&two("<CoSimulation modelIdentifier=\"a\"/>", nameless), "without a name");
        let wrong = "<ScalarVariable name=\"u\" valueReference=\"-1\"><Real/></ScalarVariable>";
        refused(&two("<CoSimulation modelIdentifier=\"a\"/>", wrong), "`u` has no value reference");
    }
}
