"""What a scene may call for beside a rigid contact on an ideal device: a file per effect, and their `catalogue`."""
