"""The model that a user describes: bodies, joints, forces, laws, motions, parameters; `mbrs.model.schema` declares their numbers."""
