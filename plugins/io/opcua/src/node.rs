//! How a node is named: an identifier in a namespace, which has a number of its own in each session.

use std::fmt;
use std::str::FromStr;

use opcua::types::{Identifier, NodeId};

/// A node by the URI of its namespace, or by its number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Node {
    namespace: Namespace,
    id: Identifier,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Namespace {
    Uri(String),
    Number(u16),
}

impl Node {
    /// Reads `nsu=URI;s=NAME`, `ns=2;s=NAME`, or `s=NAME` in the usual namespace; in place of `s=` there may be `i=`, `g=` or `b=`.
    ///
    /// # Errors
    /// When it is none of them.
    pub fn parse(text: &str, usual: Option<&str>) -> Result<Self, String> {
        let wrong = |why: &str| {
            format!(
                "\"{text}\" names no node: {why}; write \"s=NAME\" or \"i=NUMBER\" with `namespace` at the source, or \
                 \"nsu=URI;s=NAME\""
            )
        };
        let (namespace, id) = if let Some(rest) = text.strip_prefix("nsu=") {
            let (uri, id) = rest.split_once(';').ok_or(wrong("it has no identifier"))?;
            (Namespace::Uri(uri.to_owned()), id)
        } else if let Some(rest) = text.strip_prefix("ns=") {
            let (number, id) = rest.split_once(';').ok_or(wrong("it has no identifier"))?;
            let number = number.parse();
            let number = number.map_err(|_| wrong("its namespace is no number"))?;
            (Namespace::Number(number), id)
        } else {
            let uri = usual.ok_or(wrong("it has no namespace"))?;
            (Namespace::Uri(uri.to_owned()), text)
        };
        // The crate cuts the text behind two bytes.
        let is_whole = id.is_char_boundary(2) && id.len() > 2;
        let id = is_whole.then(|| Identifier::from_str(id).ok()).flatten();
        let id = id.ok_or(wrong("its identifier is none"))?;
        Ok(Self { namespace, id })
    }

    /// Whether it goes by a number that another start of the server may give another namespace.
    pub fn is_by_number(&self) -> bool {
        matches!(self.namespace, Namespace::Number(1..))
    }

    /// The node as a session with these namespaces knows it.
    ///
    /// # Errors
    /// When there is no such namespace.
    pub fn resolve(&self, namespaces: &[String]) -> Result<NodeId, String> {
        let number = match &self.namespace {
            Namespace::Number(number) => *number,
            Namespace::Uri(uri) => {
                let found = namespaces.iter().position(|of| of == uri);
                let found = found.and_then(|of| u16::try_from(of).ok());
                found.ok_or_else(|| format!("no namespace {uri}"))?
            }
        };
        Ok(NodeId {
            namespace: number,
            identifier: self.id.clone(),
        })
    }

    /// A node of a session with these namespaces by their URI.
    #[cfg(feature = "cli")]
    pub fn of(id: &NodeId, namespaces: &[String]) -> Self {
        let uri = namespaces.get(usize::from(id.namespace)).cloned();
        Self {
            namespace: uri.map_or(Namespace::Number(id.namespace), Namespace::Uri),
            id: id.identifier.clone(),
        }
    }

    /// The URI of its namespace, where it goes by that.
    #[cfg(feature = "cli")]
    pub fn uri(&self) -> Option<&str> {
        match &self.namespace {
            Namespace::Uri(uri) => Some(uri),
            Namespace::Number(_) => None,
        }
    }

    /// Its identifier within its namespace.
    #[cfg(feature = "cli")]
    pub fn identifier(&self) -> String {
        self.id.to_string()
    }
}

impl fmt::Display for Node {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.namespace {
            Namespace::Uri(uri) => write!(f, "nsu={uri};{}", self.id),
            Namespace::Number(number) => write!(f, "ns={number};{}", self.id),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_goes_by_the_uri_of_its_namespace_whatever_number_that_has() {
        let namespaces = ["http://opcfoundation.org/UA/", "urn:own", "urn:plant"];
        let namespaces = namespaces.map(str::to_owned);
        let of = |text: &str| Node::parse(text, Some("urn:plant")).unwrap();
        for (text, number, shown) in [
            ("s=Therm.Plate", 2, "nsu=urn:plant;s=Therm.Plate"),
            ("i=7", 2, "nsu=urn:plant;i=7"),
            ("nsu=urn:own;s=a;b=c", 1, "nsu=urn:own;s=a;b=c"),
            ("ns=3;s=ü", 3, "ns=3;s=ü"),
        ] {
            let node = of(text);
            let id = node.resolve(&namespaces).unwrap();
            assert_eq!((id.namespace, node.to_string().as_str()), (number, shown));
            assert_eq!(node.is_by_number(), number == 3);
        }
        let error = of("nsu=urn:late;i=1").resolve(&namespaces).unwrap_err();
        assert_eq!(error, "no namespace urn:late");
    }

    #[test]
    fn what_names_no_node_is_refused() {
        for text in [
            "",
            "ü",
            "s",
            "s=",
            "x=1",
            "i=a",
            "nsu=urn",
            "ns=a;i=1",
            "ns=70000;i=1",
            "g=1",
            "b=ü",
        ] {
            let error = Node::parse(text, Some("urn:plant")).expect_err(text);
            assert!(error.contains("names no node"), "{error}");
        }
        let error = Node::parse("s=a", None).unwrap_err();
        assert!(error.contains("`namespace`"), "{error}");
    }
}
