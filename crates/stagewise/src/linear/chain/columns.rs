//! Arithmetic on columns of the unknowns of a node, inlined into the loops over the stages.

/// The columns of a quadratic form in the unknowns of a node.
pub(super) type Columns<const N: usize> = [[f64; N]; N];

/// Adds a multiple of a column.
#[inline(always)]
pub(super) fn add_scaled<const N: usize>(into: &mut [f64; N], by: f64, column: &[f64; N]) {
    for row in 0..N {
        into[row] += by * column[row];
    }
}

/// A column plus the columns of the cost by the states, each times the growth of its state.
#[inline(always)]
pub(super) fn carried<const N: usize>(
    mut column: [f64; N],
    growth: &[f64; N],
    cost: &Columns<N>,
    states: usize,
) -> [f64; N] {
    for i in 0..states {
        add_scaled(&mut column, growth[i], &cost[i]);
    }
    column
}

/// Scalar product of two states, summed by pairs of entries to shorten the chain of dependent additions.
#[inline(always)]
pub(super) fn dot_states<const U: usize, const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let states = N - U;
    if states == 1 {
        return a[0] * b[0];
    }
    let mut sum = a[0] * b[0] + a[1] * b[1];
    let mut i = 2;
    while i + 1 < states {
        sum += a[i] * b[i] + a[i + 1] * b[i + 1];
        i += 2;
    }
    if i < states {
        sum += a[i] * b[i];
    }
    sum
}

/// Sum of products over the controls, in order.
#[inline(always)]
pub(super) fn weighted<const U: usize>(a: impl Fn(usize) -> f64, b: impl Fn(usize) -> f64) -> f64 {
    let mut sum = a(0) * b(0);
    for j in 1..U {
        sum += a(j) * b(j);
    }
    sum
}

/// The growth of the states by the controls, as scalar products with it need it: where there are more controls than two, by
/// rows too, so that the products with all columns are found at once.
pub(super) struct GrowthRows<'a, const U: usize, const N: usize> {
    columns: &'a [[f64; N]; U],
    rows: [[f64; U]; N],
}

impl<'a, const U: usize, const N: usize> GrowthRows<'a, U, N> {
    const BY_ROWS: bool = U > 2;

    #[inline(always)]
    pub(super) fn of(columns: &'a [[f64; N]; U]) -> Self {
        let mut rows = [[0.0; U]; N];
        if Self::BY_ROWS {
            for row in 0..N - U {
                for j in 0..U {
                    rows[row][j] = columns[j][row];
                }
            }
        }
        Self { columns, rows }
    }

    /// Scalar products of a state with at least the first `count` columns of the growth.
    #[inline(always)]
    pub(super) fn products(&self, state: &[f64; N], count: usize) -> [f64; U] {
        let mut products = [0.0; U];
        if Self::BY_ROWS {
            for row in 0..N - U {
                add_scaled(&mut products, state[row], &self.rows[row]);
            }
        } else {
            for i in 0..count {
                products[i] = dot_states::<U, N>(&self.columns[i], state);
            }
        }
        products
    }
}
