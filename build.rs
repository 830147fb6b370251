//! The kernels are part of the program: a changed kernel makes a new one.

fn main() {
    println!("cargo::rerun-if-changed=kernels");
}
