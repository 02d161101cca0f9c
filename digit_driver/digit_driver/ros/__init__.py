"""What the nodes of every package share: a lifecycle that no client can break, and how a process of nodes ends."""
