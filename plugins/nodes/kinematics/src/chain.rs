//! The geometry of a chain of links: how far a point moves and turns for a small motion of each. Not units, not what moves it.

/// How a link moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Freedom {
    /// It grows along this unit vector.
    Grows([f64; 3]),
    /// It turns at its beginning about this unit vector, with all that stands on it.
    Turns([f64; 3]),
}

/// Links, each standing on the end of the one before; the first stands at the origin.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Chain {
    /// Where each link begins, in m.
    begins: Vec<[f64; 3]>,
    freedoms: Vec<Freedom>,
    /// The point, in m.
    point: [f64; 3],
}

impl Chain {
    /// A chain of links, each with the vector from its beginning to its end in m, and a point that lies so far from the end of the last.
    pub(crate) fn new(links: &[([f64; 3], Freedom)], point: [f64; 3]) -> Self {
        let mut end = [0.0; 3];
        let mut begins = Vec::with_capacity(links.len());
        for (vector, _) in links {
            begins.push(end);
            end = sum(end, *vector);
        }
        Self {
            begins,
            freedoms: links.iter().map(|(_, freedom)| *freedom).collect(),
            point: sum(end, point),
        }
    }

    /// The Jacobian, link by link: how far the point moves in m, and by how much what stands on the end turns in rad, for a motion of the
    /// link by 1 m or 1 rad. It holds for motions that are small against the lengths, as thermal ones are. (Siciliano, Sciavicco,
    /// Villani and Oriolo, "Robotics", 2009, equations 3.26 to 3.30: of a prismatic joint `z` and 0, of a revolute one `z × (p − p_i)`
    /// and `z`.)
    pub(crate) fn jacobian(&self) -> Vec<[f64; 6]> {
        let columns = self.begins.iter().zip(&self.freedoms);
        let column = |(begin, freedom): (&[f64; 3], &Freedom)| match *freedom {
            Freedom::Grows([x, y, z]) => [x, y, z, 0.0, 0.0, 0.0],
            Freedom::Turns(about) => {
                let lever = [0, 1, 2].map(|nth| self.point[nth] - begin[nth]);
                let [x, y, z] = cross(about, lever);
                let [a, b, c] = about;
                [x, y, z, a, b, c]
            }
        };
        columns.map(column).collect()
    }
}

fn sum(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
