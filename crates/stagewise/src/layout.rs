//! Sizes of a programme: its stages, and the node, stage or pair of nodes of every constraint.

use std::ops::Range;

/// Rows of constraints at the same node or pair of nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Block<T> {
    /// The node, or the pair of nodes.
    pub at: T,
    /// Number of rows.
    pub rows: usize,
}

/// Sizes of a programme. Rows of constraints are stored one after the other: equalities at nodes, then between pairs of
/// nodes; inequalities at stages, then at nodes, then between pairs.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    stage_weights: Vec<f64>,
    equalities_at: Vec<Block<usize>>,
    equalities_between: Vec<Block<[usize; 2]>>,
    /// First row of every stage's inequalities, and one past the last row.
    stage_rows: Vec<usize>,
    inequalities_at: Vec<Block<usize>>,
    inequalities_between: Vec<Block<[usize; 2]>>,
    /// Weight of every inequality in the barrier.
    row_weights: Vec<f64>,
    /// Weight of every control of a node in damping; empty where all are 1.
    control_weights: Vec<f64>,
}

impl Layout {
    /// A programme without constraints. A weight is the share of a stage in the whole: it weighs the stage's
    /// inequalities in the barrier, and the controls beside the stage in damping.
    pub fn new(stage_weights: Vec<f64>) -> Self {
        Self {
            stage_rows: vec![0; stage_weights.len() + 1],
            stage_weights,
            equalities_at: Vec::new(),
            equalities_between: Vec::new(),
            inequalities_at: Vec::new(),
            inequalities_between: Vec::new(),
            row_weights: Vec::new(),
            control_weights: Vec::new(),
        }
    }

    /// Adds equalities at a node.
    ///
    /// # Panics
    ///
    /// Unless nodes are added in rising order and before pairs.
    #[must_use]
    pub fn with_equalities_at(mut self, node: usize, rows: usize) -> Self {
        let last = self.equalities_at.last().map_or(0, |block| block.at);
        assert!(self.equalities_between.is_empty() && last <= node && node < self.nodes());
        self.equalities_at.push(Block { at: node, rows });
        self
    }

    /// Adds equalities between two nodes.
    #[must_use]
    pub fn with_equalities_between(mut self, nodes: [usize; 2], rows: usize) -> Self {
        self.equalities_between.push(Block { at: nodes, rows });
        self
    }

    /// Gives every stage its number of inequalities of the controls at its two ends.
    ///
    /// # Panics
    ///
    /// Unless there is a number for every stage, and the layout has no inequalities yet.
    #[must_use]
    pub fn with_stage_inequalities(mut self, rows: impl IntoIterator<Item = usize>) -> Self {
        assert!(self.row_weights.is_empty());
        self.stage_rows.truncate(1);
        for (rows, weight) in rows.into_iter().zip(&self.stage_weights) {
            self.row_weights.extend(std::iter::repeat_n(*weight, rows));
            self.stage_rows.push(self.row_weights.len());
        }
        assert_eq!(self.stage_rows.len(), self.nodes());
        self
    }

    /// Weighs every control of a node in damping: by the inverse square of the size that counts as one. By default all weigh 1.
    #[must_use]
    pub fn with_control_weights(mut self, weights: Vec<f64>) -> Self {
        self.control_weights = weights;
        self
    }

    /// Weight of a node's control in damping.
    pub(crate) fn control_weight(&self, control: usize) -> f64 {
        self.control_weights.get(control).copied().unwrap_or(1.0)
    }

    /// Adds inequalities of a node's state and controls, with their weight in the barrier.
    ///
    /// # Panics
    ///
    /// Unless nodes are added in rising order and before pairs.
    #[must_use]
    pub fn with_inequalities_at(mut self, node: usize, rows: usize, weight: f64) -> Self {
        let last = self.inequalities_at.last().map_or(0, |block| block.at);
        assert!(self.inequalities_between.is_empty() && last <= node && node < self.nodes());
        self.inequalities_at.push(Block { at: node, rows });
        self.row_weights.extend(vec![weight; rows]);
        self
    }

    /// Adds inequalities between two nodes, with their weight in the barrier.
    #[must_use]
    pub fn with_inequalities_between(
        mut self,
        nodes: [usize; 2],
        rows: usize,
        weight: f64,
    ) -> Self {
        self.inequalities_between.push(Block { at: nodes, rows });
        self.row_weights.extend(vec![weight; rows]);
        self
    }

    /// Number of stages.
    pub fn stages(&self) -> usize {
        self.stage_weights.len()
    }

    /// Number of nodes, one more than there are stages.
    pub fn nodes(&self) -> usize {
        self.stage_weights.len() + 1
    }

    /// Share of every stage in the whole.
    pub(crate) fn stage_weights(&self) -> &[f64] {
        &self.stage_weights
    }

    /// Share of every node in the whole: half of the shares of the stages beside the node.
    pub fn node_weights(&self) -> Vec<f64> {
        let half = |k: Option<usize>| {
            let weight = k.and_then(|k| self.stage_weights.get(k));
            weight.map_or(0.0, |weight| 0.5 * weight)
        };
        (0..self.nodes())
            .map(|k| half(k.checked_sub(1)) + half(Some(k)))
            .collect()
    }

    /// Equalities at nodes, by rising node.
    pub fn equalities_at(&self) -> &[Block<usize>] {
        &self.equalities_at
    }

    /// Equalities between pairs of nodes.
    pub fn equalities_between(&self) -> &[Block<[usize; 2]>] {
        &self.equalities_between
    }

    /// Inequalities of nodes, by rising node.
    pub fn inequalities_at(&self) -> &[Block<usize>] {
        &self.inequalities_at
    }

    /// Inequalities between pairs of nodes.
    pub fn inequalities_between(&self) -> &[Block<[usize; 2]>] {
        &self.inequalities_between
    }

    /// Number of equalities.
    pub fn equalities(&self) -> usize {
        rows(&self.equalities_at) + rows(&self.equalities_between)
    }

    /// Number of equalities at nodes; those between pairs follow.
    pub fn equalities_at_nodes(&self) -> usize {
        rows(&self.equalities_at)
    }

    /// Number of inequalities.
    pub fn inequalities(&self) -> usize {
        self.row_weights.len()
    }

    /// Number of inequalities at stages; those of nodes follow, then those between pairs.
    pub fn inequalities_at_stages(&self) -> usize {
        self.stage_rows[self.stages()]
    }

    /// First row of the inequalities between pairs.
    pub(crate) fn first_pair_row(&self) -> usize {
        self.inequalities() - rows(&self.inequalities_between)
    }

    /// Rows of the inequalities of a stage.
    pub fn stage_rows(&self, stage: usize) -> Range<usize> {
        self.stage_rows[stage]..self.stage_rows[stage + 1]
    }

    /// Numbers of inequalities of the stages, in order.
    pub(crate) fn stage_counts(&self) -> impl Iterator<Item = usize> {
        self.stage_rows.windows(2).map(|ends| ends[1] - ends[0])
    }

    /// Weight of every inequality in the barrier.
    pub(crate) fn row_weights(&self) -> &[f64] {
        &self.row_weights
    }

    /// Rows of every block of equalities, in the order of their values.
    pub(crate) fn equality_blocks(&self) -> impl Iterator<Item = Range<usize>> {
        let at = self.equalities_at.iter().map(|block| block.rows);
        let between = self.equalities_between.iter().map(|block| block.rows);
        ranges(at.chain(between))
    }
}

fn rows<T>(blocks: &[Block<T>]) -> usize {
    blocks.iter().map(|block| block.rows).sum()
}

/// Ranges of these lengths, one after the other.
fn ranges(lengths: impl Iterator<Item = usize>) -> impl Iterator<Item = Range<usize>> {
    lengths.scan(0, |end, length| {
        let start = *end;
        *end += length;
        Some(start..*end)
    })
}
