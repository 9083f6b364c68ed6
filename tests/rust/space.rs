//! Numbers of indices, and the extraction of a cell.

use tawami::grid::{extraction, Basis, Functions};
use tawami::space::{
    count, index_of, indices, indices_below, number_of, strides, volume_of_cell, DIM, NODES,
};

#[test]
fn indices_are_numbered_along_x_first() {
    let size = std::array::from_fn(|axis| axis + 2);
    for (number, index) in indices_below(size).enumerate() {
        assert_eq!((number_of(index, size), index_of(number, size)), (number, index));
        let by_strides: usize = index.iter().zip(strides(size)).map(|(i, s)| i * s).sum();
        assert_eq!(by_strides, number);
    }
    assert_eq!(indices_below(size).count(), count(size));
    let block: Vec<_> = indices([[1, 2]; DIM]).collect();
    assert_eq!((block.len(), block[0], block[1][0]), (1 << DIM, [1; DIM], 2));
    assert_eq!(volume_of_cell(0.5), 0.5_f64.powi(DIM as i32));
}

#[test]
fn rows_of_an_extraction_sum_to_one_and_lagrange_functions_give_their_nodes() {
    let nodes: Vec<_> = indices_below([3; DIM]).map(|i| i.map(|i| i as f64 / 2.0)).collect();
    let nodes: [_; NODES] = nodes.try_into().unwrap();
    for basis in [Basis::QuadraticSpline, Basis::Bilinear, Basis::Biquadratic] {
        let functions = Functions { basis, cells: [3; DIM] };
        for cell in indices_below([3; DIM]) {
            let of_cell = extraction(&functions, cell, &nodes);
            assert_eq!(of_cell.functions.len(), functions.per_cell());
            for (node, row) in of_cell.values.iter().enumerate() {
                assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-15);
                if basis == Basis::Biquadratic {
                    assert_eq!(row[node], 1.0);
                }
            }
            for &function in of_cell.functions.iter() {
                let inside = |(&i, [first, last]): (&usize, [usize; 2])| first <= i && i <= last;
                assert!(cell.iter().zip(functions.support(function)).all(inside));
            }
        }
    }
}
