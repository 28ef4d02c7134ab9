//! Whose turn it is: the one who has waited longest since it was last served.

use std::collections::VecDeque;

/// Those who were served lately, the last one at the end.
#[derive(Debug)]
pub(crate) struct Turns<K> {
    served: VecDeque<K>,
    most: usize,
}

impl<K: PartialEq> Turns<K> {
    /// For as many clients as can be there at the same time.
    pub(crate) fn new(most: usize) -> Self {
        Self { served: VecDeque::with_capacity(most), most }
    }

    /// Index of the one of `waiting` whose turn it is; of equals, the first.
    pub(crate) fn next(&self, waiting: impl Iterator<Item = K>) -> Option<usize> {
        let rank = |client: &K| self.served.iter().position(|served| served == client).map_or(0, |place| place + 1);
        waiting.map(|client| rank(&client)).enumerate().min_by_key(|(_, rank)| *rank).map(|(index, _)| index)
    }

    /// Takes note that this one is being served.
    pub(crate) fn serve(&mut self, client: K) {
        self.served.retain(|served| *served != client);
        if self.served.len() == self.most {
            self.served.pop_front();
        }
        self.served.push_back(client);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_asks_again_and_again_waits_for_everybody_else() {
        let mut turns = Turns::new(3);
        let mut serve = |waiting: &[char]| {
            let next = waiting[turns.next(waiting.iter().copied()).expect("somebody waits")];
            turns.serve(next);
            next
        };
        // a and b always have two requests waiting, each the next as soon as one is served.
        let mut order = String::new();
        for waiting in ["aabb", "aabb", "aabbc", "aabbc", "aabb", "aabb", "aabbc"] {
            order.push(serve(&waiting.chars().collect::<Vec<_>>()));
        }
        assert_eq!(order, "abcabac");
        // More of them than are remembered.
        let mut turns = Turns::new(2);
        "abc".chars().for_each(|client| turns.serve(client));
        assert_eq!((turns.next("cba".chars()), turns.next("".chars())), (Some(2), None));
    }
}
