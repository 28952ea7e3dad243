//! Decides how a running node tells what it knows and takes it back; how states are kept is decided by the engine.

use std::any::Any;
use std::fmt;

use rmp_serde::decode;
use serde::Deserialize;

use crate::registry::{Sort, find};

/// What a running node knows: all that its next outputs depend on, beside its inputs.
///
/// A state is a serde struct whose registered name ends in the version of its form, `"slope/1"`. A form that has been
/// replaced stays registered, so that what was written by an older program can be read. [`state!`](crate::state)
/// makes a struct a state.
#[typetag::serialize(tag = "state")]
pub trait State: fmt::Debug + Send + Sync {
    /// The state as any value, so that a node can ask whether it is one of its own.
    fn into_any(self: Box<Self>) -> Box<dyn Any>;
}

/// Reads a state of one form.
type ReadState = fn(&[u8]) -> Result<Box<dyn State>, decode::Error>;

/// How a state of one name is read. A reader of one format alone is a tenth of the code of one for any format.
#[doc(hidden)]
pub struct StateForm {
    pub read: ReadState,
}

impl Sort for StateForm {
    const ONE: &'static str = "state";
    const MANY: &'static str = "states";
}

/// The name that a written state begins with.
#[derive(Deserialize)]
struct Tag<'a> {
    state: &'a str,
}

impl dyn State {
    /// The state in MessagePack, as a snapshot has it.
    ///
    /// # Errors
    /// When this program does not know its name, or it has another form.
    pub fn read(written: &[u8]) -> Result<Box<Self>, decode::Error> {
        let Tag { state } = rmp_serde::from_slice(written)?;
        let form = find::<StateForm>(state).map_err(<decode::Error as serde::de::Error>::custom)?;
        (form.read)(written)
    }

    /// The state as one of type `T`.
    ///
    /// # Errors
    /// When it is of another type: the answer of a node that cannot make use of it.
    pub fn known<T: State + 'static>(self: Box<Self>) -> Result<T, Restored> {
        match self.into_any().downcast() {
            Ok(state) => Ok(*state),
            Err(_) => Err(Restored::cold("the state belongs to another kind of node")),
        }
    }
}

impl dyn State {
    /// Goes on from a state of type `T`: `take` makes use of it, or says why it cannot.
    pub fn accept<T: State + 'static>(
        self: Box<Self>,
        take: impl FnOnce(T) -> Result<(), &'static str>,
    ) -> Restored {
        match self.known().map(take) {
            Ok(Ok(())) => Restored::Accepted,
            Ok(Err(reason)) => Restored::cold(reason),
            Err(cold) => cold,
        }
    }

    /// Goes on from a state that takes the place of the present one, of the same type.
    pub fn replace<T: State + 'static>(self: Box<Self>, present: &mut T) -> Restored {
        self.accept(|state| {
            *present = state;
            Ok(())
        })
    }
}

/// What a node answers when it is given a state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Restored {
    /// It goes on from there, with the same bits as if it had never stopped.
    Accepted,
    /// It starts afresh.
    Cold {
        /// Why, as a sentence without its full stop.
        reason: String,
    },
}

impl Restored {
    /// The answer of a node that starts afresh.
    #[must_use]
    pub fn cold(reason: impl Into<String>) -> Self {
        Self::Cold {
            reason: reason.into(),
        }
    }
}

/// Makes a serde struct the state of a node, under a name that ends in its version: `state!(Memory, "vote/1")`.
///
/// All crates of a program share the names: begin one with that of the kind.
#[macro_export]
macro_rules! state {
    ($state:ty, $name:literal) => {
        const _: () = {
            use $crate::__private::typetag;

            #[typetag::serialize(name = $name)]
            impl $crate::node::State for $state {
                fn into_any(self: Box<Self>) -> Box<dyn std::any::Any> {
                    self
                }
            }
        };

        $crate::__private::list!(
            $crate::node::StateForm,
            $name,
            $crate::__private::no_schema,
            $crate::node::StateForm {
                read: |written| {
                    let state: $state = $crate::__private::rmp_serde::from_slice(written)?;
                    Ok(Box::new(state))
                },
            }
        );
    };
}
