//! One of everything that a source is to give, for whoever commissions it.

use std::time::Duration as Wait;

use athermal_serve::connector::Seen;
use athermal_serve::host::time_of_day;
use opcua::types::AttributeId;
use tokio::time::timeout;

use crate::link::Link;
use crate::source::{Plan, quiet};
use crate::subscription::Subscription;
use crate::value::{code, read, stamp};

/// What the server has of each channel, and what it grants.
///
/// # Errors
/// Why it cannot be asked.
pub async fn look(plan: &Plan, patience: Wait) -> Result<Vec<Seen>, String> {
    let _quiet = quiet();
    let looked = timeout(patience, seen(plan)).await;
    looked.unwrap_or_else(|_| Err(format!("no answer in {} s", patience.as_secs())))
}

async fn seen(plan: &Plan) -> Result<Vec<Seen>, String> {
    let mut link = Link::open(&plan.settings).await?;
    let namespaces = link.namespaces().await?;
    let nodes: Vec<_> = plan
        .channels
        .iter()
        .map(|of| of.node.resolve(&namespaces))
        .collect();
    let there = nodes.iter().enumerate();
    let there = there.filter_map(|(nth, of)| Some((nth, of.as_ref().ok()?.clone())));
    let there: Vec<_> = there.collect();
    let asked: Vec<_> = there
        .iter()
        .map(|(_, id)| (id.clone(), AttributeId::Value))
        .collect();
    let values = link.read(&asked).await?;
    let subscription = Subscription::begin(&mut link, plan.sampling).await?;
    let items = there.iter().map(|(nth, id)| (*nth as u32, id.clone()));
    let granted = subscription.ask(&mut link, items.collect()).await?;
    let mut all: Vec<_> = nodes
        .iter()
        .enumerate()
        .map(|(channel, node)| Seen {
            channel,
            value: None,
            quality: node.as_ref().err().cloned().unwrap_or_default(),
            stamp: None,
            offset: None,
            granted: String::new(),
        })
        .collect();
    for (((nth, _), value), (_, granted)) in there.iter().zip(&values).zip(granted) {
        let (seen, now) = (&mut all[*nth], time_of_day());
        let asked = &plan.channels[*nth];
        match read(value, plan.uncertain, asked.is_plain) {
            Ok(value) => (seen.value, seen.quality) = (Some(value), "good".to_owned()),
            Err((_, why)) => seen.quality = why,
        }
        if let Some(stamp) = stamp(value, plan.time, now) {
            seen.stamp = jiff::Timestamp::from_nanosecond(stamp.as_ns().into())
                .ok()
                .map(|of| of.to_string());
            seen.offset = Some(now - stamp);
        }
        seen.granted = granted.map_or_else(code, |of| of.to_string().replacen("granted ", "", 1));
    }
    link.leave(Wait::from_millis(500)).await;
    Ok(all)
}
