//! One cell: its fields, the degrees of freedom of the kernels and the coefficients behind them.

use super::MAX_COEFFICIENTS;
use crate::grid::{extraction, Basis, Functions, Location};
use crate::space::{number_of, Index, Point, DIM, FUNCTIONS, NODES, NODES_1D, VERTICES};

/// Coordinates of a vertex that a kernel reads, also in the plane.
pub(super) const COORDINATES: usize = 3;

/// Degrees of freedom of the displacement alone, and with one linear field.
const DISPLACEMENT: usize = DIM * NODES;
const MIXED: usize = DISPLACEMENT + VERTICES;

/// Coordinates of all vertices of a cell, in the order of the kernels.
pub(super) type Vertices = [f64; COORDINATES * VERTICES];

/// One field of a form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Field {
    /// Its functions.
    pub basis: Basis,
    /// Its components, which every function has.
    pub components: usize,
    /// Whether its element on the mesh is quadratic along each axis, or linear as the functions.
    pub quadratic: bool,
}

/// The fields, and the positions of the kernels' degrees of freedom in a cell.
///
/// The coefficients of the fields follow one another, on the grid as on a cell: function by function, and
/// component by component.
#[derive(Debug, Clone)]
pub struct Cells {
    fields: Vec<Field>,
    /// Position of each node of a quadratic element, 0 to 1 along each axis.
    nodes: [Point; NODES],
    /// Position 0 or 1 along each axis of each vertex, which are the nodes of a linear element.
    vertices: [Index; VERTICES],
    /// The bases of the fields, each once.
    bases: Vec<Basis>,
    components: Vec<Component>,
}

/// A component of a field, on one cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Component {
    /// Position of its basis among those of [`Cells::bases`].
    pub basis: usize,
    /// Number of functions.
    pub functions: usize,
    /// Its first coefficient.
    pub first: usize,
    /// Distance to the next one.
    pub step: usize,
}

/// Coefficients of the fields on one cell.
pub(super) struct Local {
    /// Number of each coefficient on the grid.
    numbers: [usize; MAX_COEFFICIENTS],
    len: usize,
}

/// The nodal values of the fields on one cell as combinations of its coefficients.
#[derive(Default)]
pub(super) struct Nodal {
    fields: Vec<Extraction>,
}

/// The same for one field: `values[node][function]`.
struct Extraction {
    components: usize,
    nodes: usize,
    functions: usize,
    values: [[f64; FUNCTIONS]; NODES],
}

impl Field {
    /// Its functions on a grid.
    #[must_use]
    pub fn functions(&self, cells: Index) -> Functions {
        Functions { basis: self.basis, cells }
    }

    /// Nodes of its element.
    fn nodes(&self) -> usize {
        if self.quadratic {
            NODES
        } else {
            VERTICES
        }
    }

    /// Functions on a cell.
    fn per_cell(&self) -> usize {
        self.basis.per_cell().pow(DIM as u32)
    }
}

impl Cells {
    /// From the fields and the positions of the nodes of both elements, counted from 0 along each axis of a
    /// cell; `None` if there are more coefficients on a cell than [`MAX_COEFFICIENTS`], or if a field is
    /// neither a scalar nor a vector, or linear on the mesh alone.
    #[must_use]
    pub fn new(
        fields: Vec<Field>,
        nodes: [Index; NODES],
        vertices: [Index; VERTICES],
    ) -> Option<Self> {
        let nodes = nodes.map(|node| node.map(|i| i as f64 / (NODES_1D - 1) as f64));
        let (mut bases, mut components, mut first) = (Vec::new(), Vec::new(), 0);
        for field in &fields {
            let basis = bases.iter().position(|b| *b == field.basis).unwrap_or_else(|| {
                bases.push(field.basis);
                bases.len() - 1
            });
            let (functions, step) = (field.per_cell(), field.components);
            components.extend((0..step).map(|k| Component {
                basis,
                functions,
                first: first + k,
                step,
            }));
            first += functions * step;
        }
        let known = |field: &Field| {
            let linear = field.quadratic || field.basis == Basis::Bilinear;
            linear && (field.components == 1 || field.components == DIM)
        };
        let fits = first <= MAX_COEFFICIENTS && fields.iter().all(known);
        fits.then_some(Self { fields, nodes, vertices, bases, components })
    }

    /// The fields.
    #[must_use]
    pub fn fields(&self) -> &[Field] {
        &self.fields
    }

    /// Number of degrees of freedom of a kernel.
    #[must_use]
    pub fn dofs(&self) -> usize {
        self.fields.iter().map(|field| field.components * field.nodes()).sum()
    }

    /// Number of coefficients of all fields on a grid.
    #[must_use]
    pub fn coefficients(&self, cells: Index) -> usize {
        self.fields.iter().map(|field| field.components * field.functions(cells).len()).sum()
    }

    /// Number of coefficients on a cell.
    #[must_use]
    pub fn local_len(&self) -> usize {
        self.fields.iter().map(|field| field.components * field.per_cell()).sum()
    }

    /// The bases of the fields, each once.
    pub(super) fn bases(&self) -> &[Basis] {
        &self.bases
    }

    /// The components of all fields on a cell.
    pub(super) fn components(&self) -> &[Component] {
        &self.components
    }

    pub(super) fn local(&self, location: &Location, a: usize) -> Local {
        let (cells, cell) = (location.grid.cells, location.active_index(a));
        let (mut numbers, mut len, mut first) = ([0; MAX_COEFFICIENTS], 0, 0);
        for field in &self.fields {
            let functions = field.functions(cells);
            for &function in functions.on_cell(cell).iter() {
                for k in 0..field.components {
                    numbers[len] = first + field.components * function + k;
                    len += 1;
                }
            }
            first += field.components * functions.len();
        }
        Local { numbers, len }
    }

    /// Position 0 or 1 along each axis of each vertex, in the order of the kernels.
    pub(super) fn vertices_of_cell(&self) -> &[Index; VERTICES] {
        &self.vertices
    }

    /// Vertices of a cell relative to its corner. Far from the origin the size of the cell would be rounded.
    pub(super) fn vertices(&self, h: f64) -> Vertices {
        let mut x = [0.0; COORDINATES * VERTICES];
        for (vertex, x) in self.vertices.iter().zip(x.chunks_exact_mut(COORDINATES)) {
            x.iter_mut().zip(vertex).for_each(|(x, &i)| *x = h * i as f64);
        }
        x
    }
}

impl Local {
    /// Numbers of the coefficients.
    pub fn numbers(&self) -> &[usize] {
        &self.numbers[..self.len]
    }
}

impl Nodal {
    /// Compute those of the a-th active cell.
    pub fn set(&mut self, cells: &Cells, location: &Location, a: usize) {
        let cell = location.active_index(a);
        self.fields.clear();
        for field in &cells.fields {
            let functions = field.functions(location.grid.cells);
            let mut values = [[0.0; FUNCTIONS]; NODES];
            if field.quadratic {
                values = extraction(&functions, cell, &cells.nodes).values;
            } else {
                // the functions are those of the vertices
                for (values, &vertex) in values.iter_mut().zip(&cells.vertices) {
                    values[number_of(vertex, [2; DIM])] = 1.0;
                }
            }
            self.fields.push(Extraction {
                components: field.components,
                nodes: field.nodes(),
                functions: field.per_cell(),
                values,
            });
        }
    }

    /// Values at the degrees of freedom: `T c`.
    pub fn values(&self, numbers: &[usize], coefficients: &[f64], out: &mut [f64]) {
        let (mut numbers, mut out) = (numbers, out.iter_mut());
        for field in &self.fields {
            let (mine, others) = numbers.split_at(field.components * field.functions);
            for value in &field.values[..field.nodes] {
                for (k, out) in (0..field.components).zip(&mut out) {
                    let functions = mine[k..].iter().step_by(field.components);
                    *out = value.iter().zip(functions).map(|(v, &c)| v * coefficients[c]).sum();
                }
            }
            numbers = others;
        }
    }

    /// `T^T a` for `columns` vectors at once: `a` is degrees of freedom x columns.
    pub fn transposed(&self, a: &[f64], columns: usize, out: &mut [f64]) {
        // constant widths of one or two fields, which the compiler turns into vector instructions without
        // loops: these save a third of the time
        match columns {
            1 => self.transposed_of(a, [0.0; 1], out),
            DISPLACEMENT => self.transposed_of(a, [0.0; DISPLACEMENT], out),
            MIXED => self.transposed_of(a, [0.0; MIXED], out),
            _ => self.transposed_of(a, vec![0.0; columns], out),
        }
    }

    fn transposed_of(&self, a: &[f64], mut sum: impl AsMut<[f64]>, out: &mut [f64]) {
        let sum = sum.as_mut();
        let columns = sum.len();
        let (mut a, mut out) = (a, out.chunks_exact_mut(columns));
        for field in &self.fields {
            let width = field.components * columns;
            let (mine, others) = a.split_at(field.nodes * width);
            for f in 0..field.functions {
                for (k, out) in (0..field.components).zip(&mut out) {
                    sum.fill(0.0);
                    for (value, rows) in field.values.iter().zip(mine.chunks_exact(width)) {
                        let v = value[f];
                        if v == 0.0 {
                            continue;
                        }
                        let row = &rows[k * columns..][..columns];
                        sum.iter_mut().zip(row).for_each(|(s, r)| *s += v * r);
                    }
                    out.copy_from_slice(sum);
                }
            }
            a = others;
        }
    }
}
