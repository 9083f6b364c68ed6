//! One cell: the degrees of freedom of the kernels and the coefficients behind them.

use crate::grid::{extraction, Basis, Extraction, Functions, Location};
use crate::space::{Index, Point, DIM, DISPLACEMENT_DOFS, MAX_DOFS, NODES, NODES_1D, VERTICES};

/// Coordinates of a vertex that a kernel reads, also in the plane.
const COORDINATES: usize = 3;

/// Coordinates of all vertices of a cell, in the order of the kernels.
pub(super) type Vertices = [f64; COORDINATES * VERTICES];

/// Positions of the kernels' degrees of freedom in a cell, and the fields behind them.
#[derive(Debug, Clone)]
pub struct Cells {
    /// Basis of the displacement.
    basis: Basis,
    /// Position of each node of the displacement, 0 to 1 along each axis.
    nodes: [Point; NODES],
    /// Position 0 or 1 along each axis of each vertex.
    vertices: [Index; VERTICES],
    /// Whether there is a linear field besides the displacement.
    linear: bool,
}

/// Coefficients of the fields on one cell.
pub(super) struct Local {
    /// Number of each coefficient on the cell: function by function and component by component, then the
    /// vertices.
    numbers: [usize; MAX_DOFS],
    len: usize,
}

/// The nodal values on one cell as combinations of its coefficients.
pub(super) struct Nodal<'a> {
    local: &'a Local,
    extraction: Extraction<NODES>,
}

impl Cells {
    /// From the positions of the kernels' nodes, counted from 0 along each axis of a cell.
    #[must_use]
    pub fn new(
        basis: Basis,
        nodes: [Index; NODES],
        vertices: [Index; VERTICES],
        linear: bool,
    ) -> Self {
        let nodes = nodes.map(|node| node.map(|i| i as f64 / (NODES_1D - 1) as f64));
        Self { basis, nodes, vertices, linear }
    }

    /// Number of degrees of freedom of a kernel.
    #[must_use]
    pub fn dofs(&self) -> usize {
        DISPLACEMENT_DOFS + if self.linear { VERTICES } else { 0 }
    }

    /// Functions of the displacement on a grid.
    #[must_use]
    pub fn displacement(&self, cells: Index) -> Functions {
        Functions { basis: self.basis, cells }
    }

    /// Functions of the linear field on a grid, if there is one.
    #[must_use]
    pub fn linear(&self, cells: Index) -> Option<Functions> {
        self.linear.then_some(Functions { basis: Basis::Bilinear, cells })
    }

    /// Number of coefficients of all fields on a grid; those of the displacement come first.
    #[must_use]
    pub fn coefficients(&self, cells: Index) -> usize {
        let linear = self.linear(cells).map_or(0, |functions| functions.len());
        DIM * self.displacement(cells).len() + linear
    }

    pub(super) fn local(&self, location: &Location, a: usize) -> Local {
        let (cells, cell) = (location.grid.cells, location.active_index(a));
        let displacement = self.displacement(cells);
        let mut local = Local { numbers: [0; MAX_DOFS], len: 0 };
        for &function in displacement.on_cell(cell).iter() {
            (0..DIM).for_each(|k| local.push(DIM * function + k));
        }
        if let Some(linear) = self.linear(cells) {
            let first = DIM * displacement.len();
            for vertex in &self.vertices {
                let index = std::array::from_fn(|axis| cell[axis] + vertex[axis]);
                local.push(first + linear.number(index));
            }
        }
        local
    }

    pub(super) fn nodal<'a>(&self, location: &Location, a: usize, local: &'a Local) -> Nodal<'a> {
        let displacement = self.displacement(location.grid.cells);
        Nodal {
            local,
            extraction: extraction(&displacement, location.active_index(a), &self.nodes),
        }
    }

    /// Number of coefficients on a cell.
    #[must_use]
    pub fn local_len(&self) -> usize {
        let displacement = DIM * self.basis.per_cell().pow(DIM as u32);
        displacement + if self.linear { VERTICES } else { 0 }
    }

    /// Whether there is a linear field besides the displacement.
    #[must_use]
    pub fn has_linear(&self) -> bool {
        self.linear
    }

    /// Position 0 or 1 along each axis of each vertex, in the order of the coefficients.
    pub(super) fn vertices_of_cell(&self) -> &[Index; VERTICES] {
        &self.vertices
    }

    /// Vertices of a cell relative to its corner. No form names the position, and far from the origin the
    /// size of the cell would be rounded.
    pub(super) fn vertices(&self, h: f64) -> Vertices {
        let mut x = [0.0; COORDINATES * VERTICES];
        for (vertex, x) in self.vertices.iter().zip(x.chunks_exact_mut(COORDINATES)) {
            x.iter_mut().zip(vertex).for_each(|(x, &i)| *x = h * i as f64);
        }
        x
    }
}

impl Local {
    fn push(&mut self, number: usize) {
        self.numbers[self.len] = number;
        self.len += 1;
    }

    /// Numbers of the coefficients.
    pub fn numbers(&self) -> &[usize] {
        &self.numbers[..self.len]
    }
}

impl Nodal<'_> {
    fn functions(&self) -> usize {
        self.extraction.functions.len()
    }

    /// Values at the degrees of freedom: `T c`.
    pub fn values(&self, coefficients: &[f64], out: &mut [f64]) {
        let (functions, numbers) = (self.functions(), self.local.numbers());
        for (value, out) in self.extraction.values.iter().zip(out.chunks_exact_mut(DIM)) {
            for (k, o) in out.iter_mut().enumerate() {
                let term = |f: usize| value[f] * coefficients[numbers[DIM * f + k]];
                *o = (0..functions).map(term).sum();
            }
        }
        for (o, &c) in out[DISPLACEMENT_DOFS..].iter_mut().zip(&numbers[DIM * functions..]) {
            *o = coefficients[c];
        }
    }

    /// `T^T a` for `columns` vectors at once: `a` is degrees of freedom x columns.
    pub fn transposed(&self, a: &[f64], columns: usize, out: &mut [f64]) {
        // constant widths, which the compiler turns into vector instructions without loops
        match columns {
            1 => self.transposed_of(a, [0.0; 1], out),
            DISPLACEMENT_DOFS => self.transposed_of(a, [0.0; DISPLACEMENT_DOFS], out),
            MAX_DOFS => self.transposed_of(a, [0.0; MAX_DOFS], out),
            _ => self.transposed_of(a, vec![0.0; columns], out),
        }
    }

    fn transposed_of(&self, a: &[f64], mut sum: impl AsMut<[f64]>, out: &mut [f64]) {
        let (functions, sum) = (self.functions(), sum.as_mut());
        let columns = sum.len();
        let (displacement, rest) = out.split_at_mut(DIM * functions * columns);
        for (target, f) in displacement.chunks_exact_mut(DIM * columns).zip(0..) {
            for (k, target) in target.chunks_exact_mut(columns).enumerate() {
                sum.fill(0.0);
                for (node, value) in self.extraction.values.iter().enumerate() {
                    let v = value[f];
                    if v == 0.0 {
                        continue;
                    }
                    let row = &a[(DIM * node + k) * columns..][..columns];
                    for (s, r) in sum.iter_mut().zip(row) {
                        *s += v * r;
                    }
                }
                target.copy_from_slice(sum);
            }
        }
        let vertices = &a[DISPLACEMENT_DOFS * columns..];
        rest[..vertices.len()].copy_from_slice(vertices);
    }
}
