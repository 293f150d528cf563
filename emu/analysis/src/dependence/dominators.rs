// SPDX-License-Identifier: MIT OR Apache-2.0
//! Immediate dominators of a graph, by the iterative algorithm of Cooper, Harvey and Kennedy (2001).

/// Immediate dominator of each node: the last node, other than itself, that lies on every path from `root` to it; `None` for the root and
/// unreachable nodes. `to` lists each node's successors, `before` its predecessors; a caller that swaps the two and starts from the exit
/// gets post-dominators.
pub(super) fn dominators(to: &[Vec<usize>], before: &[Vec<usize>], root: usize) -> Vec<Option<usize>> {
    // Postorder by depth-first search: a node comes after its successors, back edges excepted.
    let (mut order, mut seen) = (Vec::new(), vec![false; to.len()]);
    let mut stack = vec![(root, 0)];
    seen[root] = true;
    while let Some((node, next)) = stack.last_mut() {
        let node = *node;
        match to[node].get(*next) {
            Some(&following) => {
                *next += 1;
                if !std::mem::replace(&mut seen[following], true) {
                    stack.push((following, 0));
                }
            }
            None => {
                order.push(node);
                stack.pop();
            }
        }
    }
    let mut number = vec![0; to.len()];
    for (place, &node) in order.iter().enumerate() {
        number[node] = place;
    }
    let mut found: Vec<Option<usize>> = vec![None; to.len()];
    found[root] = Some(root);
    let mut changed = true;
    while changed {
        changed = false;
        for &node in order.iter().rev().filter(|&&node| node != root) {
            let mut last: Option<usize> = None;
            for &from in before[node].iter().filter(|&&from| found[from].is_some()) {
                last = Some(match last {
                    None => from,
                    Some(last) => common(&found, &number, last, from),
                });
            }
            if last != found[node] {
                (found[node], changed) = (last, true);
            }
        }
    }
    found[root] = None;
    found
}

/// Nearest common dominator of two nodes: climbs the dominator tree from each until they meet.
fn common(found: &[Option<usize>], number: &[usize], mut one: usize, mut other: usize) -> usize {
    while one != other {
        let later = if number[one] < number[other] { &mut one } else { &mut other };
        match found[*later] {
            Some(before) if before != *later => *later = before,
            // The root alone has no dominator, and its postorder number is the largest.
            _ => return one.max(other),
        }
    }
    one
}

#[cfg(test)]
mod tests {
    use super::dominators;

    #[test]
    fn dominators_of_a_branch_in_a_loop() {
        // Edges 0 -> 1 -> 2 or 3 -> 4 -> 1 or 5
        let to = [vec![1], vec![2, 3], vec![4], vec![4], vec![1, 5], vec![]];
        let mut before = vec![Vec::new(); to.len()];
        for (from, to) in to.iter().enumerate() {
            to.iter().for_each(|&to| before[to].push(from));
        }
        let over = [None, Some(0), Some(1), Some(1), Some(1), Some(4)];
        assert_eq!(dominators(&to, &before, 0), over);
        let under = [Some(1), Some(4), Some(4), Some(4), Some(5), None];
        assert_eq!(dominators(&before, &to, 5), under);
    }
}
