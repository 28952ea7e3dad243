//! The host's clock, and whether it is right.

use crate::time::Instant;

/// The host's time where the kernel says that it is synchronised; none elsewhere, as on an edge PC that has just booted in 1970.
///
/// The kernel's own bound of the clock's error decides, as systemd's `NTPSynchronized` has it: whatever disciplines the clock (chrony,
/// ntpd, systemd-timesyncd, a PTP daemon) keeps it below 16 s, and it grows to that where nothing does. The flag `STA_UNSYNC` is not
/// looked at: chrony leaves it set where the kernel is not to write the clock of the mainboard. Only Linux is asked.
#[must_use]
pub fn synchronised() -> Option<Instant> {
    is_synchronised().then(now).flatten()
}

/// The kernel's bound of the error of a clock that nothing disciplines, in µs.
#[cfg(target_os = "linux")]
const UNDISCIPLINED_US: i64 = 16_000_000;

#[cfg(target_os = "linux")]
fn is_synchronised() -> bool {
    // Without a mode it only reads, for which nothing need be allowed.
    let mut asked = rtime_clock::adjtime::Timex::new();
    rtime_clock::adjtime::adjtimex(&mut asked).is_ok() && asked.0.maxerror < UNDISCIPLINED_US
}

#[cfg(not(target_os = "linux"))]
fn is_synchronised() -> bool {
    false
}

/// The host's time as it is, right or not; none before 1970.
#[must_use]
pub fn now() -> Option<Instant> {
    let since = std::time::UNIX_EPOCH.elapsed().ok()?;
    i64::try_from(since.as_nanos()).ok().map(Instant::from_ns)
}

/// The host's time, right or not, as it is stamped where nothing else gives one; 1970 where it is before that.
#[must_use]
pub fn time_of_day() -> Instant {
    now().unwrap_or(Instant::from_ns(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernel_can_be_asked_and_a_time_that_it_vouches_for_is_that_of_the_system() {
        let before = now().unwrap();
        match synchronised() {
            Some(time) => assert!(time >= before && time <= now().unwrap()),
            None => println!("the clock of this machine is not synchronised"),
        }
        #[cfg(target_os = "linux")]
        assert!(rtime_clock::adjtime::adjtimex(&mut rtime_clock::adjtime::Timex::new()).is_ok());
    }
}
