//! The figures of the shipped LTC table beside those of the published one.
//!
//! `cargo bench -p bevy_akari_benches --bench ltc_table`

fn main() {
    match akari_ltc_fit::Table::from_bytes(akari_math::ltc::table::TABLE_BYTES) {
        Ok(table) => print!("{}", akari_ltc_fit::report(&akari_ltc_fit::quality(&table))),
        Err(error) => {
            eprintln!("the shipped table is not one: {error}");
            std::process::exit(1);
        }
    }
}
