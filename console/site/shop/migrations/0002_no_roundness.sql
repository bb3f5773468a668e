ALTER TABLE shop.measurements ALTER COLUMN ront_um DROP NOT NULL;  -- a part measured in points that are no sections
