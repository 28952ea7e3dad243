//! The codes of what can be wrong with the text of a graph file.

use crate::diagnostic::code;

code!(
    A001,
    Error,
    "syntax",
    "The file is not TOML. Every syntax error is shown; nothing else is checked until there is none."
);

code!(
    A002,
    Error,
    "unreadable file",
    "A file named on the command line or by `extends` cannot be read, or is not UTF-8."
);

code!(
    A003,
    Error,
    "too large",
    "Files have at most 16 MB, lists 200,000 values, tables nest at most 64 deep, and `extends` chains have at most 16 files."
);

code!(
    A004,
    Error,
    "schema",
    "Every graph file says `schema = 1`, so that a later version of the language is never misread."
);

code!(
    A005,
    Error,
    "extends",
    "`extends` names one file. A chain of files that comes back to itself has no beginning."
);

code!(
    A006,
    Error,
    "unknown key",
    "Unknown keys are errors everywhere, since a misspelt one would silently have no effect."
);

code!(
    A007,
    Error,
    "missing key",
    "A table lacks a key that has no default."
);

code!(
    A008,
    Error,
    "wrong type of value",
    "A key has a value of another type than it needs. Durations and quantities are texts with a unit."
);

code!(
    A009,
    Error,
    "unknown choice",
    "A text names none of the choices that the key has."
);

code!(
    A010,
    Error,
    "value out of range",
    "A value has the right type and is refused by what reads it."
);

code!(
    A011,
    Error,
    "bad name",
    "Names begin with a letter, then letters, digits, `_` and `-`; members and channels may begin with a digit."
);

code!(
    A012,
    Error,
    "duplicate name",
    "Nodes, sets and signals share one name space; members of a set and channels of a signal are distinct."
);

code!(
    A013,
    Error,
    "unknown set",
    "`each` or `channels` names a set that `[sets]` does not have."
);

code!(
    A014,
    Error,
    "unknown placeholder",
    "`{x}` stands for a member of a set that the node has in its `each`; `{channel}` for a signal's channel."
);

code!(
    A015,
    Error,
    "empty list",
    "A set, a list of channels or a list of references has no entries."
);

code!(
    A016,
    Error,
    "too many instances",
    "`each` would expand the graph beyond what fits into memory."
);

code!(
    A017,
    Error,
    "unknown unit",
    "A unit is a UCUM code or a common spelling of one. Differences of temperatures are in K."
);

code!(
    A018,
    Error,
    "duration or quantity",
    "A duration is a number and a unit of time, a quantity a number and a UCUM unit, in one text."
);

code!(
    A019,
    Error,
    "nothing to remove",
    "`nodes.NAME = false` removes an inherited node and `outputs.NAME = false` an inherited output, and there is none of that name."
);

code!(
    A020,
    Error,
    "samples without sample time",
    "`2 samples` has a meaning only where `[time]` counts samples."
);

code!(
    A021,
    Error,
    "column pattern",
    "The columns of a signal with several channels must differ: the pattern contains `{channel}`."
);

code!(
    A022,
    Error,
    "bad range",
    "A range is `[low, high]`, both in units that convert to the signal's, the low one below the high one."
);

code!(
    A023,
    Error,
    "unknown channel",
    "`optional` names a channel that the signal does not have."
);

code!(
    A024,
    Error,
    "contradicting time",
    "`[time]` says two things that exclude each other, e.g. both `step` and a unit, or a `format` beside one."
);

code!(
    A025,
    Error,
    "unknown module",
    "`module = \"…\"` names a module that `[modules]` does not have, neither here nor in the file that the module comes from."
);

code!(
    A026,
    Error,
    "endless modules",
    "A module cannot be part of itself, and modules nest at most 16 deep."
);

code!(
    A027,
    Error,
    "out of a module's reach",
    "Inside a module a reference names one of its nodes or begins with one of its inputs, so that it means the same wherever it is used."
);

code!(
    A028,
    Error,
    "unknown output of a module",
    "A reference to an instance of a module names one of the outputs that the module declares; without one it means the first."
);
