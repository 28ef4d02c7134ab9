//! A few equations in joint velocities, row by row.

/// Rows that are left shorter than this beside the rows before are none of full rank: of a Jacobian in
/// m and rad.
const NOTHING_LEFT: f64 = 1e-9;

/// One row for each equation, one number for each joint.
pub(crate) type Rows = Vec<Vec<f64>>;

pub(crate) fn product(row: &[f64], x: &[f64]) -> f64 {
    row.iter().zip(x).map(|(row, x)| row * x).sum()
}

/// What is left of a vector beside an orthonormal basis: Gram and Schmidt, twice.
fn beside(mut vector: Vec<f64>, basis: &[Vec<f64>]) -> Vec<f64> {
    for _ in 0..2 {
        for along in basis {
            let share = product(along, &vector);
            vector.iter_mut().zip(along).for_each(|(vector, along)| *vector -= share * along);
        }
    }
    vector
}

fn length(vector: &[f64]) -> f64 {
    product(vector, vector).sqrt()
}

fn of_length_one(vector: Vec<f64>) -> Vec<f64> {
    let length = length(&vector);
    vector.into_iter().map(|part| part / length).collect()
}

/// The shortest x with A x = b, of an A with full row rank; not finite of any other.
pub(crate) fn least_norm(rows: &Rows, wanted: &[f64]) -> Vec<f64> {
    let joints = rows.first().map_or(0, Vec::len);
    let (mut basis, mut shortest): (Rows, Vec<f64>) = (Vec::new(), vec![0.0; joints]);
    for (row, wanted) in rows.iter().zip(wanted) {
        let new = beside(row.clone(), &basis);
        if length(&new) < NOTHING_LEFT {
            return vec![f64::NAN; joints];
        }
        let new = of_length_one(new);
        // Nothing along it yet: the row has so much of it, and asks for what is missing.
        let share = (wanted - product(row, &shortest)) / product(row, &new);
        shortest.iter_mut().zip(&new).for_each(|(x, new)| *x += share * new);
        basis.push(new);
    }
    shortest
}

/// An orthonormal basis of the joint velocities that rows of full rank do not see.
pub(crate) fn unseen(rows: &Rows) -> Rows {
    let joints = rows.first().map_or(0, Vec::len);
    let (mut basis, mut found) = (Rows::new(), Rows::new());
    for row in rows {
        basis.push(of_length_one(beside(row.clone(), &basis)));
    }
    // Then the unit vectors, the one that is left longest first.
    while basis.len() < joints {
        let unit = |joint: usize| (0..joints).map(|other| f64::from(u8::from(other == joint))).collect();
        let left = (0..joints).map(|joint| beside(unit(joint), &basis));
        let Some(longest) = left.max_by(|a, b| length(a).total_cmp(&length(b))) else { break };
        let longest = of_length_one(longest);
        found.push(longest.clone());
        basis.push(longest);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_solution_has_nothing_that_the_rows_do_not_see() {
        let rows = vec![vec![1.0, 0.5, -0.2, 0.3], vec![0.0, 2.0, 0.3, -1.0]];
        let x = least_norm(&rows, &[0.7, -0.4]);
        assert!((product(&rows[0], &x) - 0.7).abs() < 1e-14 && (product(&rows[1], &x) + 0.4).abs() < 1e-14);
        let spare = unseen(&rows);
        assert_eq!(spare.len(), 2);
        for vector in &spare {
            assert!(rows.iter().all(|row| product(row, vector).abs() < 1e-14));
            assert!((length(vector) - 1.0).abs() < 1e-14 && product(vector, &x).abs() < 1e-14);
        }
        assert!(product(&spare[0], &spare[1]).abs() < 1e-14);
        let singular = vec![vec![1.0, 0.5, -0.2, 0.3], vec![2.0, 1.0, -0.4, 0.6]];
        assert!(least_norm(&singular, &[0.0; 2]).iter().all(|x| x.is_nan()));
    }
}
