//! What is known not to run on an adapter, with the reason. An entry that is not true any more fails the check.

/// Chains that have this text in them do not fit the adapters that have this in their names.
pub struct Known {
    pub adapter: &'static str,
    pub chain_has: &'static str,
    pub reason: &'static str,
}

pub const KNOWN: &[Known] = &[Known {
    adapter: "SwiftShader",
    chain_has: "LastFrame",
    reason: "a kernel binds 12 storage buffers, and the adapter has 10",
}];

/// The entry about a chain on an adapter.
pub fn find(adapter: &str, chain: &str) -> Option<&'static Known> {
    KNOWN.iter().find(|known| adapter.contains(known.adapter) && chain.contains(known.chain_has))
}
