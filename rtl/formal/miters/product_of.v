// SPDX-License-Identifier: MIT OR Apache-2.0
// The significands of two operands and a number that stands for their product. With EXACT it is their product.

module product_of (
    input  [31:0] a,
    input  [31:0] b,
    input  [47:0] p,
    output [23:0] x,            // significands
    output [23:0] y,
    output [4:0]  x_zeros,      // their leading zeros
    output [4:0]  y_zeros,
    output [47:0] product,      // of the significands
    output [47:0] normal,       // that of the normalised significands
    output        finite,       // both operands are finite and not zero: else the product is not used
    output        proper        // p can be a product of these
);

    assign x = {|a[30:23], a[22:0]};
    assign y = {|b[30:23], b[22:0]};
    leading_zeros of_x (.x(x), .zeros(x_zeros));
    leading_zeros of_y (.x(y), .zeros(y_zeros));
    assign finite = ~&a[30:23] & ~&b[30:23] & (|a[30:0]) & (|b[30:0]);

`ifdef EXACT
    assign product = x * y;
    assign proper  = 1'b1;
`else
    // The product of the normalised significands is 2^46 to 2^48 - 1, and a multiple of 2^zeros.
    wire [5:0]  zeros = {1'b0, x_zeros} + {1'b0, y_zeros};
    assign product = (|x & |y) ? p : 48'd0;
    assign proper  = ~(|x & |y) | (((normal >> zeros) == product) & (normal[47] | normal[46]));
`endif
    assign normal = product << x_zeros << y_zeros;

endmodule
