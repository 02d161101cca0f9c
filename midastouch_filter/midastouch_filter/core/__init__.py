"""The recursion's parts: `belief` keeps the hypotheses, `comparison` weighs them by a keyframe (maps by `alignment` and
`noise_model`, codes by `measurement_model`), `answer` makes modes of them, `state` says how sure it is."""
