"""The running job, published to whoever watches: snapshots out, orders of the lease holder in."""
