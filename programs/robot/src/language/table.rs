// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tables of commands and functions, for the parser's suggestions, `help`, completion and the documentation.

/// Command of the language or of the prompt.
#[derive(Clone, Copy, Debug)]
pub struct Command {
    /// First word of the command.
    pub name: &'static str,
    /// Syntax, with placeholders in capitals.
    pub syntax: &'static str,
    /// Complete command that can be typed.
    pub example: &'static str,
    /// Description for `help` and the documentation.
    pub text: &'static str,
    /// Known to the prompt alone.
    pub console: bool,
}

const fn row(name: &'static str, syntax: &'static str, example: &'static str, text: &'static str) -> Command {
    Command { name, syntax, example, text, console: false }
}

const fn console(
    name: &'static str,
    syntax: &'static str,
    example: &'static str,
    text: &'static str,
) -> Command {
    Command { name, syntax, example, text, console: true }
}

/// All commands, in the order of the documentation.
pub const COMMANDS: &[Command] = &[
    row(
        "move",
        "move TARGET [at DEG/S | in S | fast] [profile NAME]",
        "move joints(0, 90, 0, 0, -45, 0) at 30",
        "Moves the joints to joint angles or to a pose; the program waits for the end.",
    ),
    row(
        "movel",
        "movel TARGET [at MM/S | in S | fast] [profile NAME]",
        "movel pose(420, _, _, _, _, _) at 100",
        "Moves the tool to a pose along a straight line, its angles linear in time.",
    ),
    row(
        "via",
        "via move ... | via movel ...",
        "via movel pose(420, _, _, _, _, _) at 100",
        "Moves on into the motion that follows without stopping; the program goes on at once.",
    ),
    row(
        "start",
        "start move ... | start movel ...",
        "start move joints(10, _, _, _, _, _)",
        "Starts a motion; the program goes on while it runs (`wait done` waits for its end).",
    ),
    row(
        "check",
        "check move ... | check movel ... | check [\"FILE\"]",
        "check move joints(10, _, _, _, _, _)",
        "Asks the controller whether a motion is possible and how long it takes, without moving; or, at the prompt, runs a file or the session's program in a copy of the robot.",
    ),
    row(
        "jog",
        "jog joints|world|gripper R1, R2, R3, R4, R5, R6 [for S] | jog off",
        "jog world 50, 0, 0, 0, 0, 0 for 1",
        "Moves at rates: of the joints, deg/s; of the tool along and about the world's axes or its own, mm/s and deg/s. Without `for`, until the next `jog`.",
    ),
    row("stop", "stop", "stop", "Stops on the path, as fast as the limits allow, and empties the queue."),
    row(
        "speed",
        "speed JOINTS [, LINE] | speed fast",
        "speed 60, 200",
        "Sets the default speed of motions: deg/s of the fastest joint and mm/s along lines, or as fast as the limits allow.",
    ),
    row(
        "profile",
        "profile rectangular|trapezoidal|parabolic|cosine",
        "profile cosine",
        "Sets the default acceleration profile of motions.",
    ),
    row(
        "signal",
        "signal NUMBER on|off",
        "signal 1 on",
        "Sets a digital output when the motions before it have ended.",
    ),
    row(
        "level",
        "level CHANNEL, VALUE",
        "level 1, 2.5",
        "Sets an analogue output, 1 or 2, when the motions before it have ended.",
    ),
    row(
        "wait",
        "wait S | wait done | wait input NUMBER on|off [for S] | wait until CONDITION [for S]",
        "wait input 3 on for 5",
        "Waits for a time, for the end of all motions, or for a signal; `for` limits the wait.",
    ),
    row("tool", "tool X, Y, Z", "tool 0, 0, 100", "Sets the tool's point in the flange's frame, mm."),
    row(
        "limits",
        "limits speed V1, ..., V6 | limits torque T1, ..., T6",
        "limits speed 90, 90, 90, 180, 180, 180",
        "Limits the joints' speeds, deg/s, or the drives' torques, N*m, below the built-in limits.",
    ),
    row("reset", "reset", "reset", "Leaves the error state."),
    row("where", "where", "where", "Shows joint angles, pose and signals."),
    row("say", "say ITEM, ...", "say \"at \", pose()", "Shows texts and values."),
    row(
        "teach",
        "teach NAME [joints]",
        "teach corner",
        "Names the present pose (or the joint angles), and adds it to the program that is being recorded.",
    ),
    row("let", "let NAME = VALUE", "let above = frame(0, 0, 50, 0, 0, 0)", "Gives a value a name."),
    row(
        "if",
        "if CONDITION ... [else if CONDITION ...] [else ...] end",
        "if input(1)\nend",
        "Executes the block of the first condition that holds.",
    ),
    row("repeat", "repeat NUMBER ... end", "repeat 3\nend", "Repeats the block this many times."),
    row(
        "while",
        "while CONDITION ... end",
        "while input(1)\nwait 0.1\nend",
        "Repeats the block as long as the condition holds.",
    ),
    row(
        "sub",
        "sub NAME(PARAMETER, ...) ... end",
        "sub pick(place)\nmovel place\nend",
        "Defines a subprogram; names assigned in it are local.",
    ),
    row("call", "call NAME(VALUE, ...)", "call pick(pose())", "Calls a subprogram."),
    row("return", "return", "sub nothing()\nreturn\nend", "Ends a subprogram."),
    row(
        "try",
        "try ... else ... end",
        "try\nmovel pose(2000, _, _, _, _, _)\nelse\nreset\nend",
        "Executes the block after `else` if the robot refuses a motion or stops, or a wait times out; `cause()` has the reason.",
    ),
    row(
        "simulate",
        "simulate input NUMBER on|off [after S] | simulate analogue CHANNEL, VALUE [after S] | simulate FAULT [after S]",
        "simulate input 3 on after 2",
        "Simulates events around the robot: inputs, and faults of the link (corrupt, order, late, silent).",
    ),
    console("help", "help [COMMAND]", "help jog", "Lists the commands, or explains one."),
    console("run", "run [\"FILE\"]", "run \"square.robot\"", "Runs a file, or the session's program."),
    console("load", "load \"FILE\"", "load \"square.robot\"", "Loads a file as the session's program."),
    console("save", "save \"FILE\"", "save \"mine.robot\"", "Writes the session's program to a file."),
    console("list", "list", "list", "Shows the session's program."),
    console("new", "new", "new", "Empties the session's program."),
    console(
        "record",
        "record on|off",
        "record on",
        "Turns recording of typed commands into the session's program on or off.",
    ),
    console("step", "step", "step", "Executes the next statement of the session's program."),
    console("continue", "continue", "continue", "Executes the rest of the session's program."),
    console("quit", "quit", "quit", "Ends the session."),
];

/// Function of the language.
#[derive(Clone, Copy, Debug)]
pub struct Function {
    /// Name of the function.
    pub name: &'static str,
    /// Syntax with the names of its arguments.
    pub syntax: &'static str,
    /// Permitted numbers of arguments.
    pub arguments: &'static [usize],
    /// Description of the result.
    pub text: &'static str,
}

const fn function(
    name: &'static str,
    syntax: &'static str,
    arguments: &'static [usize],
    text: &'static str,
) -> Function {
    Function { name, syntax, arguments, text }
}

/// All functions, in the order of the documentation.
pub const FUNCTIONS: &[Function] = &[
    function(
        "joints",
        "joints(a1, ..., a6)",
        &[0, 6],
        "Joint angles, deg; without arguments the present ones.",
    ),
    function(
        "pose",
        "pose(x, y, z, roll, pitch, yaw)",
        &[0, 6],
        "A pose of the tool, mm and deg (docs/arm.md); without arguments the present one.",
    ),
    function(
        "frame",
        "frame(x, y, z, rx, ry, rz) or frame(pose)",
        &[1, 6],
        "A transformation: turned about x, then y, then z, and shifted, mm and deg; or the tool's axes at a pose.",
    ),
    function("inverse", "inverse(frame)", &[1], "The transformation back."),
    function("input", "input(number)", &[1], "A digital input, 0 or 1."),
    function("analogue", "analogue(channel)", &[1], "An analogue input."),
    function("time", "time()", &[0], "s since power-up."),
    function("cause", "cause()", &[0], "Number of the last error's cause; 0 if there was none."),
    function("abs", "abs(x)", &[1], "Without its sign."),
    function("sqrt", "sqrt(x)", &[1], "The square root."),
    function("sin", "sin(angle)", &[1], "Of an angle in deg."),
    function("cos", "cos(angle)", &[1], "Of an angle in deg."),
    function("atan2", "atan2(y, x)", &[2], "deg."),
    function("min", "min(a, b)", &[2], "The smaller."),
    function("max", "max(a, b)", &[2], "The larger."),
    function("floor", "floor(x)", &[1], "The next whole number below."),
];

/// Words that cannot name a variable.
pub const RESERVED: &[&str] = &[
    "and", "or", "not", "else", "end", "at", "in", "for", "fast", "after", "on", "off", "done", "until", "_",
];

/// A reserved word, command or function, which cannot name a variable.
pub fn is_reserved(word: &str) -> bool {
    RESERVED.contains(&word)
        || COMMANDS.iter().any(|command| command.name == word)
        || FUNCTIONS.iter().any(|function| function.name == word)
}

/// Function with this name.
pub fn function_named(name: &str) -> Option<&'static Function> {
    FUNCTIONS.iter().find(|function| function.name == name)
}

/// Command with this name.
pub fn command_named(name: &str) -> Option<&'static Command> {
    COMMANDS.iter().find(|command| command.name == name)
}

/// Names of commands with this prefix, for completion.
pub fn complete(begin: &str) -> Vec<String> {
    let names = COMMANDS.iter().map(|command| command.name);
    names.filter(|name| name.starts_with(begin)).map(str::to_owned).collect()
}
